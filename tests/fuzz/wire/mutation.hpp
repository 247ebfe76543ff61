#pragma once
/// \file
/// Bytes that are wrong in one of many ways.

#include <algorithm>
#include <array>
#include <cstdint>
#include <random>
#include <vector>

namespace jostle::tests {

using Bytes = std::vector<std::uint8_t>;

/// Spoils bytes: cuts, lengthens, changes single ones, numbers and lengths; what lies before `from` stays as it is.
/// Equal randomness spoils equally.
inline Bytes mutated(Bytes bytes, std::size_t from, std::mt19937_64& random) {
  const auto below = [&](std::size_t bound) { return bound == 0 ? 0 : static_cast<std::size_t>(random() % bound); };
  if (bytes.size() <= from) bytes.resize(from + 1);
  const std::size_t size = bytes.size() - from;
  const auto begin = bytes.begin() + static_cast<std::ptrdiff_t>(from);
  const auto put = [&](std::uint64_t value, std::size_t width) {
    const std::size_t at = size < width ? 0 : below(size - width + 1) / width * width;
    for (std::size_t i = 0; i < width && at + i < size; ++i)
      begin[static_cast<std::ptrdiff_t>(at + i)] = static_cast<std::uint8_t>(value >> (8 * i));
  };
  switch (random() % 9) {
    case 0:
      bytes.resize(from + below(size));
      break;
    case 1:
      for (std::size_t i = 1 + below(8); i > 0; --i)
        begin[static_cast<std::ptrdiff_t>(below(size))] = static_cast<std::uint8_t>(random());
      break;
    case 2: {
      constexpr std::array<std::uint32_t, 7> kLengths{0, 1, 0xff, 0x7fffffff, 0x80000000, 0x10000000, 0xffffffff};
      put(kLengths[below(kLengths.size())], 4);
      break;
    }
    case 3: {
      // NaN, the infinities, the largest, the least that is not normal, minus zero
      constexpr std::array<std::uint64_t, 6> kNumbers{
          0x7ff8000000000000, 0x7ff0000000000000, 0xfff0000000000000, 0x7fefffffffffffff, 1, 0x8000000000000000};
      put(kNumbers[below(kNumbers.size())], 8);
      break;
    }
    case 4:
      for (std::size_t i = below(4096); i > 0; --i) bytes.push_back(static_cast<std::uint8_t>(random()));
      break;
    case 5: {
      const std::size_t at = below(size), count = below(size - at);
      bytes.erase(begin + static_cast<std::ptrdiff_t>(at), begin + static_cast<std::ptrdiff_t>(at + count));
      break;
    }
    case 6:
      std::for_each(begin, bytes.end(), [&](std::uint8_t& byte) {
        if (random() % 20 == 0) byte = static_cast<std::uint8_t>(random() % 3 ? random() : 0xff);
      });
      break;
    case 7:
      begin[static_cast<std::ptrdiff_t>(below(size))] ^= static_cast<std::uint8_t>(1u << below(8));
      break;
    default:
      put(std::array<std::uint16_t, 4>{0xffff, 0, 0x7fff, 1}[below(4)], 2);
      break;
  }
  return bytes;
}

}  // namespace jostle::tests
