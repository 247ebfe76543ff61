#pragma once
/// \file
/// A planner's scene with an arm in place of the hand that the planner knows.

#include <array>

#include "idl/types/result.hpp"
#include "physics_pool/scene/scene.hpp"
#include "robot_bridge/planar/arm_in_plane.hpp"

namespace jostle::world {

/// Joints of the planar gripper, in its model's order.
inline constexpr std::size_t kHandX = 0, kHandY = 1, kHandRotation = 2, kLeftFinger = 3, kRightFinger = 4;

/// Returns the scene with the built-in ur5_2f85 where it has the planar gripper: mounted as `mounting` says, its hand
/// where the gripper starts, `mounting.height` above the surface.
/// Error kInvalidArgument: another robot, or a start out of the arm's reach.
Result<physics_pool::Scene> with_arm(const physics_pool::Scene& scene, const robot_bridge::planar::Mounting& mounting);

/// Returns joints of ur5_2f85 that put its hand where joints of the planar gripper [5] say.
/// Error kInvalidArgument: out of reach.
Result<std::vector<double>> arm_joints(std::span<const double> gripper, const robot_bridge::planar::Mounting& mounting);

}  // namespace jostle::world
