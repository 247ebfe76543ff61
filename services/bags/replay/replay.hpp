#pragma once
/// \file
/// Replay: a recorded run's observations, given to the planner again.

#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "physics_pool/api/pool.hpp"
#include "services/bags/recorded/recorded_run.hpp"
#include "services/bags/replay/changes.hpp"
#include "services/bags/replay/comparison.hpp"

namespace jostle::bags {

struct ReplayOptions {
  std::vector<std::string> settings;  ///< KEY=VALUE, see apply_changes(); empty: as recorded
  double rate = 0.0;  ///< recorded seconds per second between observations; 0: as fast as they are wanted
  /// Called for every plan, with the recorded plan at the same place (or null).
  std::function<void(const jostle_msgs::msg::Plan& replayed, const jostle_msgs::msg::Plan* recorded,
                     const StateLayout& layout)>
      on_plan;
};

struct ReplayReport {
  jostle_msgs::msg::TaskRun recorded, here;  ///< what the run was made by, and what replayed it
  std::vector<Change> changes;               ///< options that are not as recorded
  Decisions decisions;
  Comparison comparison;
  std::string ended;  ///< the replay's own end, a sentence

  /// What can explain a difference, most likely first; never empty where there is one.
  std::vector<std::string> reasons() const;
};

/// Performs the goal of a recorded run again, on what was observed then, and compares every
/// plan and every action. Without changes, on the same build and machine type, all are
/// equal to the last bit.
/// Threads  one.
/// Errors   those of apply_changes and Task::prepare; kCancelled
Result<ReplayReport> replay(const RecordedRun& recorded, const ReplayOptions& options, physics_pool::AsyncPool& pool,
                            std::stop_token stop = {});

}  // namespace jostle::bags
