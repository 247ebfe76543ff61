#pragma once
/// \file
/// Joints and axes of the built-in robots, by number.

#include "physics_pool/robot/robot_yaml.hpp"

namespace jostle::tests {

/// Of State::q of the planar gripper; a pusher has the first two.
enum PlanarJoint : int { kJointX, kJointY, kJointRotation, kJointLeft, kJointRight };

/// Of a control of the planar gripper; a pusher has the first two.
enum PlanarAxis : int { kControlX, kControlY, kControlRotation, kControlOpening };

/// The planar gripper's.
inline const physics_pool::Hand kHand = *physics_pool::builtin_robot("planar_gripper").value().hand;

inline constexpr int kGripperControls = 4, kPusherControls = 2;  // nu

}  // namespace jostle::tests
