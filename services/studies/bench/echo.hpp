#pragma once
/// \file
/// Bare Fast DDS to another process that answers: what the middleware alone costs.

#include <chrono>
#include <cstdint>
#include <vector>

#include "services/studies/bench/measurement.hpp"
#include "services/studies/bench/swarm.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"

namespace jostle::studies {

/// A reliable message that takes longer does not come any more.
inline constexpr std::chrono::seconds kLost{30};

/// Times of single round trips, microseconds, and the runs they make up.
class Trips {
 public:
  void add(std::chrono::steady_clock::time_point start);

  /// Median of those since the last run's end; `hash` of what they brought.
  Sample finish(const Hash& hash);

  const std::vector<double>& all() const { return all_; }

 private:
  std::vector<double> all_;
  std::size_t first_ = 0;  // of the present run
};

/// This process's end; serve_echo() is the other's. Topics of the pool's type and promise
/// under names of their own. An assignment that wants all trajectories gets its nominal controls
/// back as one, so that as much returns as was sent; others get an empty outcome.
class Echo {
 public:
  using Assignment = jostle_msgs::msg::Assignment;
  using Answer = jostle_msgs::msg::AssignmentResult;

  explicit Echo(const wire::Participant& participant);

  /// Sends until an answer comes: only that shows that both directions work. Errors
  /// kUnavailable, with the last words of a helper that ended.
  Result<void> meet(Assignment assignment, Helpers& helpers);

  /// One round trip.
  Result<Answer> ask(Assignment& assignment);

  /// `count` of them, no more than `window` under way.
  Result<void> stream(Assignment& assignment, int count, int window);

 private:
  Result<Answer> answer_since(std::uint64_t epoch);

  wire::Writer<Assignment> ping_;
  wire::Inbox<Answer> pong_;
  std::uint64_t epoch_ = 0;  // of the newest question
};

/// The message that the pool sends for the first sample of such a batch.
jostle_msgs::msg::Assignment assignment_of(const physics_pool::RolloutBatch& batch);

/// What a worker answers to an empty sample.
physics_pool::RolloutOutcome empty_outcome(std::uint32_t sample);

}  // namespace jostle::studies
