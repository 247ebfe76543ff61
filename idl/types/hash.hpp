#pragma once
/// \file
/// Content hashes: the names of worlds and plans.

#include <compare>
#include <cstdint>
#include <cstring>
#include <functional>
#include <span>
#include <string>
#include <string_view>

namespace jostle {

/// A Hash is 128 bits of XXH3; equal content has an equal hash on every machine.
struct Hash {
  std::uint64_t high = 0;
  std::uint64_t low = 0;

  auto operator<=>(const Hash&) const = default;
  bool empty() const { return high == 0 && low == 0; }
};

/// Writes 32 lower-case hexadecimal digits.
std::string to_string(const Hash& hash);

Hash hash_of(std::string_view bytes);

/// Hashes the bits of the values: -0.0 differs from 0.0, so equal hashes mean bit-equal values.
Hash hash_of(std::span<const double> values);

}  // namespace jostle

template <>
struct std::hash<jostle::Hash> {
  std::size_t operator()(const jostle::Hash& value) const noexcept { return static_cast<std::size_t>(value.low); }
};
