#pragma once
/// \file
/// A message of a type that is known by its .msg file only: tests/data/messages.

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>
#include <vector>

namespace jostle::tests {

inline const std::string kMessageFolder = JOSTLE_SOURCE_DIR "/tests/data/messages";
inline constexpr const char* kWheelType = "rover_msgs/msg/Wheel";

/// Returns CDR of a wheel at 5 s and 6 ns in frame "a" that turns at 1.5 rad/s, with one tread of wear 0.25 and the
/// codes 7 and 8.
inline std::vector<std::byte> wheel() {
  std::vector<std::byte> bytes(4 + 34 + 2);  // a multiple of four, as all on the wire is
  bytes[1] = std::byte{1};                   // little-endian
  const auto put = [&](std::size_t at, auto value) { std::memcpy(bytes.data() + 4 + at, &value, sizeof value); };
  put(0, std::int32_t{5});
  put(4, std::uint32_t{6});
  put(8, std::uint32_t{2});
  put(12, std::array{'a', '\0'});
  put(16, 1.5);
  put(24, std::uint32_t{1});
  put(28, 0.25f);
  put(32, std::array<std::uint8_t, 2>{7, 8});
  return bytes;
}

}  // namespace jostle::tests
