#pragma once
/// \file
/// What-if: the goal of a recorded run with other options.

#include <string>
#include <vector>

#include "idl/msg/task.h"
#include "idl/types/result.hpp"

namespace jostle::bags {

/// One option that is not what was recorded.
struct Change {
  std::string key, recorded, replayed;
};

/// Sets options of a goal, each "KEY=VALUE". KEY is controller, predictor, seed or
/// plan_only, or a key of the parameters such as planner.rollouts. Says what changed;
/// what already was so is no change.
/// Errors   kInvalidArgument  not KEY=VALUE, an unknown key, or a value that it cannot have
Result<std::vector<Change>> apply_changes(const std::vector<std::string>& settings, jostle_msgs::msg::Goal& goal);

}  // namespace jostle::bags
