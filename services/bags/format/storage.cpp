#include "services/bags/format/storage.hpp"

namespace jostle::bags {

const Storage& storage_of(BagOptions::Storage storage) {
  return storage == BagOptions::Storage::kSqlite ? sqlite_storage() : mcap_storage();
}

const Storage* storage_of(const std::filesystem::path& file) {
  for (const Storage* storage : {&mcap_storage(), &sqlite_storage()}) {
    if (file.extension() == storage->extension) return storage;
  }
  return nullptr;
}

}  // namespace jostle::bags
