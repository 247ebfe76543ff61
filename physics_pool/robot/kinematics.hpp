#pragma once
/// \file
/// Where the links of a robot are.

#include <span>
#include <vector>

#include "idl/types/transform.hpp"
#include "physics_pool/robot/robot_model.hpp"

namespace jostle::physics_pool {

/// Returns X_WL of a link. `base` is X_WB, `q` [joints].
Eigen::Isometry3d link_pose(const RobotModel& model, const Eigen::Isometry3d& base, std::span<const double> q,
                            int link);

/// Returns X_WT of the tool: the hand's frame G where there is a hand, else the last link's.
Eigen::Isometry3d tool_pose(const RobotModel& model, const Eigen::Isometry3d& base, std::span<const double> q);

/// [nu] An upper bound, of the stretched robot, of how fast any of its points moves per unit of each axis: metres for
/// an axis that turns joints, 1 for one that slides.
std::vector<double> axis_reaches(const RobotModel& model);

/// Returns |u|, m/s: the Euclidean norm over axes. An axis that turns joints counts with a lever of 0.1 m.
double control_norm(const RobotModel& model, std::span<const double> u);

}  // namespace jostle::physics_pool
