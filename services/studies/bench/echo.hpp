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

/// A reliable message that takes longer than this does not come any more.
inline constexpr std::chrono::seconds kLost{30};

/// Trips collects times of single round trips, microseconds, and makes runs of them.
class Trips {
 public:
  void add(std::chrono::steady_clock::time_point start);

  /// Ends a run: returns the median of the times since the last run's end. `hash`: that of what the trips brought.
  Sample finish(const Hash& hash);

  const std::vector<double>& all() const { return all_; }

 private:
  std::vector<double> all_;
  std::size_t first_ = 0;  // the present run's
};

/// This process's end of the echo; serve_echo() is the other process's. The topics have the pool's types and promises,
/// under names of their own. An assignment that wants all trajectories gets its nominal controls
/// back as one, so that as much returns as was sent; others get an empty outcome.
class Echo {
 public:
  using Assignment = jostle_msgs::msg::Assignment;
  using Answer = jostle_msgs::msg::AssignmentResult;

  explicit Echo(const wire::Participant& participant);

  /// Sends until an answer comes: only that shows that both directions work. Error
  /// kUnavailable, with the last words of a helper that ended.
  Result<void> meet(Assignment assignment, Helpers& helpers);

  /// Makes one round trip.
  Result<Answer> ask(Assignment& assignment);

  /// Makes `count` round trips, no more than `window` under way at a time.
  Result<void> stream(Assignment& assignment, int count, int window);

 private:
  Result<Answer> answer_since(std::uint64_t epoch);

  wire::Writer<Assignment> ping_;
  wire::Inbox<jostle_msgs::msg::AssignmentResults> pong_;
  std::uint64_t epoch_ = 0;  // of the newest question
};

/// Returns the message that the pool sends for the first sample of a batch.
jostle_msgs::msg::Assignment assignment_of(const physics_pool::RolloutBatch& batch);

/// Returns what a worker answers to an empty sample.
physics_pool::RolloutOutcome empty_outcome(std::uint32_t sample);

}  // namespace jostle::studies
