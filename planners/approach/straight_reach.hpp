#pragma once
/// \file
/// Straight motions of robots whose hand does not move in the plane by itself.

#include "idl/types/state.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::planners {

/// Returns `steps` controls that would bring the hand, as it is turned, straight and level to its pre-grasp distance
/// from the target if nothing were in the way. Within a step joints keep their speeds, so between its ends the hand is
/// a little off the line; no speed is above its axis's limit. Where kinematics finds no way on, the robot stands.
ControlSequence straight_reach(const physics_pool::TaskGeometry& geometry, const State& x, int steps,
                               double step_duration);

/// Returns controls that lead the hand over poses in turn, one of them at the end of each step. `q`: joints before;
/// other axes than those that move the tool are given 0.
ControlSequence follow(const physics_pool::TaskGeometry& geometry, std::span<const double> q,
                       std::span<const Eigen::Isometry3d> poses, double step_duration);

}  // namespace jostle::planners
