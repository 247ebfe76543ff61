#pragma once
/// \file
/// What both halves of the pool agree on beside the messages.

#include <chrono>
#include <cstdint>
#include <random>

namespace jostle::pool {

/// The time between two heartbeats of a worker; five missed ones make it dead.
inline constexpr std::chrono::milliseconds kHeartbeatPeriod{100};

/// The values of BatchControl::kind.
enum class ControlKind : std::uint8_t { kCancel = 0, kCost = 1, kSuccess = 2 };

/// Returns an id that no other process picks.
inline std::uint64_t random_id() {
  std::random_device device;
  return (static_cast<std::uint64_t>(device()) << 32) | device();
}

}  // namespace jostle::pool
