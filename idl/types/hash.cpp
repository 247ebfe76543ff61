#include "idl/types/hash.hpp"

#include <fmt/format.h>
#include <xxhash.h>

namespace jostle {
namespace {

Hash hash_bytes(const void* bytes, std::size_t size) {
  const XXH128_hash_t digest = XXH3_128bits(bytes, size);
  return Hash{.high = digest.high64, .low = digest.low64};
}

}  // namespace

std::string to_string(const Hash& hash) { return fmt::format("{:016x}{:016x}", hash.high, hash.low); }

Hash hash_of(std::string_view bytes) { return hash_bytes(bytes.data(), bytes.size()); }

Hash hash_of(std::span<const double> values) { return hash_bytes(values.data(), values.size_bytes()); }

}  // namespace jostle
