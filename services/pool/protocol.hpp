#pragma once
/// \file
/// What both halves of the pool agree on beside the messages.

#include <chrono>
#include <cstdint>

namespace jostle::pool {

/// The time between two heartbeats of a worker, unless its clients ask for fewer; five missed ones make it dead.
inline constexpr std::chrono::milliseconds kHeartbeatPeriod{100};
/// The longest that clients may ask for.
inline constexpr std::chrono::milliseconds kLongestHeartbeatPeriod{1000};

/// The values of BatchControl::kind.
enum class ControlKind : std::uint8_t { kCancel = 0, kCost = 1, kSuccess = 2, kHeartbeats = 3 };

}  // namespace jostle::pool
