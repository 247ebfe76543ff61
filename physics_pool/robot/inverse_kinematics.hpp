#pragma once
/// \file
/// Joints that bring a robot's tool somewhere.

#include <optional>
#include <span>
#include <vector>

#include "idl/types/transform.hpp"
#include "physics_pool/robot/robot_model.hpp"

namespace jostle::physics_pool {

/// Returns joints [joints] that bring the tool (tool_pose) to X_WT, near `q`, within their ranges; nothing if none were
/// found. Joints that do not move the tool, such as fingers, stay as they are.
///
/// Damped least squares from `q`: of an arm that could come there in several ways, it finds one that is near, and
/// sometimes none although there is one farther away.
///
/// Accuracy  1e-6 m and rad
/// Source    Wampler, "Manipulator inverse kinematic solutions based on vector formulations and damped least-squares
///           methods", IEEE Transactions on Systems, Man, and Cybernetics 1986
std::optional<std::vector<double>> joints_at(const RobotModel& model, const Eigen::Isometry3d& base,
                                             const Eigen::Isometry3d& X_WT, std::span<const double> q);

}  // namespace jostle::physics_pool
