#pragma once
/// \file
/// Planar motion of an arm (thesis, Sec. 5.6.3): the planner's hand moves in a plane above the surface; six joints keep
/// it there.

#include <Eigen/Geometry>
#include <array>
#include <optional>

#include "idl/types/result.hpp"
#include "robot_bridge/ur/kinematics.hpp"

namespace jostle::robot_bridge::planar {

using ur::Joints;

/// Where the arm stands, and how it holds its hand.
struct Mounting {
  /// X_WB: the arm's base in the world, whose origin is on the surface. By default beside a table of 0.6 m, at its near
  /// end, in the middle: the hand may be 0.33 m before it, where the folded forearm passes the shoulder, to 1.01 m,
  /// where the elbow is straight, so that plans have 0.1 m to back off before the table, and fingers reach its far end.
  Eigen::Isometry3d base{Eigen::Translation3d(-0.78, 0.0, 0.0)};
  /// X_TG: frame G of the hand in the flange: x along the tool, 107 mm ahead; z up.
  Eigen::Isometry3d hand{Eigen::Translation3d(0.0, 0.0, 0.107) * Eigen::Quaterniond(0.5, -0.5, -0.5, -0.5)};
  double height = 0.055;  ///< of G above the surface, m: the wrist's lower end just clears it
};

/// A pose of the hand in its plane.
struct PlanarPose {
  double x = 0.0, y = 0.0;  ///< m, of G in the world
  double rotation = 0.0;    ///< rad, of G's x axis; not limited to a turn
};
/// Speeds of the hand, in the world's axes: m/s, m/s, rad/s.
struct PlanarVelocity {
  double x = 0.0, y = 0.0, rotation = 0.0;
};

/// Returns X_BT: where the flange must be for the hand to be there.
Eigen::Isometry3d flange_at(const Mounting& mounting, const PlanarPose& pose);

/// Returns where the hand is, seen from above; its rotation within half a turn of `near`, rad.
PlanarPose planar_pose(const Mounting& mounting, const ur::Dh& dh, const Joints& q, double near = 0.0);

/// How far a hand is out of its plane.
struct Deviation {
  double height = 0.0;  ///< m
  double tilt = 0.0;    ///< rad, between G's z axis and the vertical
};
Deviation deviation(const Mounting& mounting, const ur::Dh& dh, const Joints& q);

/// Returns joints that bring the hand there, with the elbow and the first wrist as high as can be, so that they stay
/// above what stands on the surface. Nothing if it is out of reach.
std::optional<Joints> joints_at(const Mounting& mounting, const ur::Dh& dh, const PlanarPose& pose);

/// An ArmInPlane leads the hand along a path in the plane, joint speeds out: what it did before decides, not time.
///
/// Where the joints cannot be as fast as the path asks, the hand is slower on the same path; where they cannot follow
/// at all (out of reach, a straight elbow) it stops. Allocates: closed-form solutions only. One thread.
class ArmInPlane {
 public:
  ArmInPlane(const Mounting& mounting, const ur::Dh& dh) : mounting_(mounting), dh_(dh) {}

  /// Begins a motion from where the arm is: the hand goes on from its measured place, in its plane.
  /// Error kInvalidArgument: the hand is more than `kMostHeight` or `kMostTilt` out of the plane, or out of reach; says
  /// where it should be.
  Result<void> begin(const Joints& measured);

  /// Returns the joint speeds, rad/s, for the next dt seconds at the velocity `v`, from measured joints.
  /// Error kInvalidArgument: the path leaves the arm's reach; the hand should stop.
  Result<Joints> follow(const PlanarVelocity& v, const Joints& measured, double dt);

  /// Returns where the hand should be by now.
  const PlanarPose& reference() const { return pose_; }

  static constexpr double kMostHeight = 0.01;  ///< m
  static constexpr double kMostTilt = 0.05;    ///< rad

 private:
  static constexpr double kFastest = 2.5;    // rad/s, of a joint; the arm's own limit is pi
  static constexpr double kStiffness = 8.0;  // 1/s: how fast what is behind is made up for

  const Mounting mounting_;
  const ur::Dh dh_;
  PlanarPose pose_;  // reference
  Joints q_{};       // at pose_
};

}  // namespace jostle::robot_bridge::planar
