#pragma once
/// \file
/// Outbox: when a worker's results leave, and together with which others.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "idl/msg/pool.h"
#include "idl/types/time.hpp"

namespace jostle::pool {

/// What a client still has at the worker when one of its samples is done.
enum class Left {
  kNothing,  ///< it waits for this result
  kRunning,  ///< nothing in line: threads will be idle until more comes
  kWaiting,  ///< some in line
};

/// An Outbox gathers results, so that a worker with many threads sends one message where it would send
/// dozens. A result never waits for longer than `gather`, and does not wait where its client has nothing
/// else here:
///
///   kNothing  leaves at once, and what waited for the client leaves with it
///   kRunning  leaves kBurst after the client's last message
///   kWaiting  leaves `gather` after it
///
/// A message that has got long leaves at once.
///
/// Threads  one at a time.
class Outbox {
 public:
  static constexpr std::chrono::microseconds kBurst{300};
  /// Bytes, about, from which on a message leaves: it fits a datagram.
  static constexpr std::size_t kLong = 48'000;

  /// Results for one client.
  struct Group {
    std::uint64_t client = 0;
    std::vector<jostle_msgs::msg::AssignmentResult> results;
  };

  /// True if something has to leave sooner than before.
  bool put(std::uint64_t client, jostle_msgs::msg::AssignmentResult result, Left left, std::chrono::nanoseconds gather,
           TimePoint now);

  /// Takes out what has to leave by now.
  std::vector<Group> take(TimePoint now);

  /// Returns when to take out next; nothing if nothing waits.
  std::optional<TimePoint> due() const;

  /// Returns how many results wait for a client.
  std::size_t held(std::uint64_t client) const;

  /// Forgets a client that has gone, and its results.
  void forget(std::uint64_t client) { boxes_.erase(client); }

 private:
  struct Box {
    std::vector<jostle_msgs::msg::AssignmentResult> results;
    std::size_t bytes = 0;
    TimePoint due;
    TimePoint last_sent;
  };

  std::map<std::uint64_t, Box> boxes_;  // by client
};

}  // namespace jostle::pool
