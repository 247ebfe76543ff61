#pragma once
/// \file
/// RecordedRun: all that decided a task, and what was decided, from a bag.

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "idl/msg/task.h"
#include "idl/types/result.hpp"
#include "planners/execution/execution.hpp"
#include "services/bags/format/bag_reader.hpp"

namespace jostle::bags {

/// Reads a recorded GoalResult: as it is now, or as it was before `ending` was added at its end, which is
/// then kUnknown.
/// Error kInvalidArgument: it is neither.
Result<jostle_msgs::msg::GoalResult> result_from_cdr(std::span<const std::byte> data);

/// How a recorded run ended. The one place that reads it from the sentence: results recorded before
/// there was a field for it (`ending` is kUnknown) began theirs with "timeout", or said "cancelled" or
/// "refused", and had an error where parts of the system failed.
planners::Ending ending_of(const jostle_msgs::msg::GoalResult& result);

struct RecordedRun {
  jostle_msgs::msg::TaskRun run;
  Time begin = 0, end = 0;  ///< when the run was heard of first, and when its result, or the bag's end
  std::vector<jostle_msgs::msg::Observation> observations;  ///< entry i has number i
  std::vector<Time> observed;                               ///< when each was recorded
  std::vector<jostle_msgs::msg::Plan> plans;                ///< entry i has number i
  std::optional<jostle_msgs::msg::GoalResult> result;       ///< nothing: the recording ends before
  std::vector<std::string> unreadable;  ///< messages of such topics in the bag that cannot be read, of any run

  /// Whether the run came to an end of its own, rather than being cancelled, timed out or cut off.
  bool concluded() const;
};

/// Returns the run of a goal, or every run if `goal_id` is empty.
/// Error kNotFound if there is no such goal; names those there are.
Result<std::vector<RecordedRun>> select_runs(std::vector<RecordedRun> runs, const std::string& goal_id);

/// Reads every run of a bag, in the order they were taken up. Topics are found by their types,
/// whatever namespace they are in.
/// Errors   kNotFound         no run in it; says what there is and the remedy
///          kInvalidArgument  an observation or a plan is missing; names it, and why as far as the bag knows
///          those of BagReader
Result<std::vector<RecordedRun>> read_runs(BagReader& reader);

}  // namespace jostle::bags
