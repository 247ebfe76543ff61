#pragma once
/// \file
/// Measures of the planar gripper, a Robotiq 2F-85 held level above the
/// surface. Everything in metres, in the gripper's frame: origin G in the
/// middle of the palm's face, x forward, y to the left.

namespace jostle::physics_pool::planar_gripper {

inline constexpr double kStroke = 0.085;        // largest opening, data sheet
inline constexpr double kFingerLength = 0.070;  // fingertip 163 mm above a 93 mm base
inline constexpr double kFingerThickness = 0.015;
inline constexpr double kFingerHeight = 0.022;  // pad width, data sheet; upright here
inline constexpr double kFingerZ = 0.020;       // centre above the surface
inline constexpr double kPalmDepth = 0.093;     // base of the 2F-85
inline constexpr double kPalmWidth = 0.120;     // carries both fingers when open
inline constexpr double kPalmHeight = 0.060;
inline constexpr double kPalmZ = 0.035;
inline constexpr double kArmLength = 0.35;  // wrist and forearm, flange to elbow
inline constexpr double kArmWidth = 0.09;

/// Pre-grasp region: where the target's centre counts as inside the hand.
inline constexpr double kGraspNear = 0.010;         // ahead of the palm's face
inline constexpr double kGraspFar = kFingerLength;  // between the fingers
inline constexpr double kGraspSide = 0.030;         // either side of the centre line
inline constexpr double kGraspDepth = 0.040;        // where straight lines aim to have it

}  // namespace jostle::physics_pool::planar_gripper
