#pragma once
/// \file
/// What a bridge's guard holds an arm's hand to.

#include <vector>

#include "physics_pool/scene/scene.hpp"
#include "robot_bridge/safety/guard.hpp"
#include "robot_bridge/ur/arm_hand.hpp"

namespace jostle::world {

/// Returns a guard's options for `hand`: its limits, twice the change between two controls that good plans were seen to
/// ask for, no way that brings the arm to itself, to the surface or to a fixture; reports go to the log. A fixture that
/// is a cylinder counts as the box round it. `hand` outlives the guard.
robot_bridge::GuardOptions arm_guard(robot_bridge::ur::ArmHand& hand, const robot_bridge::ur::PlanarArmOptions& arm,
                                     const std::vector<physics_pool::Fixture>& fixtures);

}  // namespace jostle::world
