#pragma once
/// \file
/// CRC-32 as MCAP and zlib have it.

#include <zlib.h>

#include <cstddef>
#include <cstdint>
#include <span>

namespace jostle::bags {

/// Returns the checksum of some bytes with `data` behind them. `before` is the checksum of those bytes; 0: there are
/// none.
inline std::uint32_t crc32_of(std::span<const std::byte> data, std::uint32_t before = 0) {
  if (data.empty()) return before;  // zlib takes a null pointer for "start anew"
  return static_cast<std::uint32_t>(crc32_z(before, reinterpret_cast<const Bytef*>(data.data()), data.size()));
}

/// Returns the checksum of two pieces in a row from the checksums of both. `size`: that of the second piece, bytes.
inline std::uint32_t crc32_of_both(std::uint32_t first, std::uint32_t second, std::size_t size) {
  return static_cast<std::uint32_t>(crc32_combine(first, second, static_cast<z_off_t>(size)));
}

}  // namespace jostle::bags
