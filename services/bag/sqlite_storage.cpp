#include "services/bag/storage.hpp"

namespace jostle::bag {
namespace {

Error not_yet() { return {Code::kUnavailable, "sqlite3: not built yet"}; }

}  // namespace

const Storage& sqlite_storage() {
  static constexpr Storage kStorage{
      "sqlite3", ".db3",
      [](const std::filesystem::path&, const BagOptions&) -> Result<std::unique_ptr<FileWriter>> { return not_yet(); },
      [](const std::filesystem::path&, const OpenOptions&) -> Result<std::unique_ptr<FileReader>> { return not_yet(); }};
  return kStorage;
}

}  // namespace jostle::bag
