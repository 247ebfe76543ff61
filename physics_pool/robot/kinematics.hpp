#pragma once
/// \file
/// Where the links of a robot are.

#include <span>

#include "idl/types/transform.hpp"
#include "physics_pool/robot/robot_model.hpp"

namespace jostle::physics_pool {

/// X_WL of a link. `base` is X_WB, `q` [joints].
Eigen::Isometry3d link_pose(const RobotModel& model, const Eigen::Isometry3d& base, std::span<const double> q,
                            int link);

/// X_WT of the tool: the hand's frame G where there is a hand, else the last link's.
Eigen::Isometry3d tool_pose(const RobotModel& model, const Eigen::Isometry3d& base, std::span<const double> q);

}  // namespace jostle::physics_pool
