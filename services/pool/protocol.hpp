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

/// How long a result may wait at a worker for others of the same client, by the time between heartbeats that this
/// client wants: both grow with the number of workers that it listens to.
constexpr std::chrono::nanoseconds gathering_time(std::chrono::milliseconds period) { return period / 10; }

/// The values of BatchControl::kind.
enum class ControlKind : std::uint8_t { kCancel = 0, kCost = 1, kSuccess = 2, kHeartbeats = 3 };

}  // namespace jostle::pool
