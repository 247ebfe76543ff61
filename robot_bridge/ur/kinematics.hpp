#pragma once
/// \file
/// Kinematics of a Universal Robots arm: forward, Jacobian, and closed-form inverse.

#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <vector>

namespace jostle::robot_bridge::ur {

/// Joint angles from base to wrist 3, rad.
using Joints = std::array<double, 6>;

/// A row of standard Denavit-Hartenberg parameters: turn about z by q + theta, move along z by d, along x by a, turn
/// about x by alpha.
struct DhRow {
  double a = 0.0, d = 0.0, alpha = 0.0;  ///< m, m, rad
  double theta = 0.0;                    ///< rad; 0 of arms as drawn
};

/// The geometry of an arm whose shoulder and elbow axes are parallel, and whose wrist has right angles: what all arms
/// of the family have as drawn. A calibrated arm differs a little, and then has no closed form (calibration.hpp).
struct Dh {
  std::array<DhRow, 6> rows;

  /// Returns the UR5 as drawn. Source: the maker's published table.
  static const Dh& ur5();
};

/// Returns X_BT: the flange (frame of joint 6) in the robot's base.
Eigen::Isometry3d flange_pose(const Dh& dh, const Joints& q);

/// Returns the Jacobian of the flange's origin: rows linear velocity, m/s, then angular velocity, rad/s, both in the
/// base frame.
Eigen::Matrix<double, 6, 6> jacobian(const Dh& dh, const Joints& q);

/// Returns every joint vector in (-pi, pi]^6 that brings the flange to X_BT: at most 8, for shoulder, wrist and elbow
/// each in two ways, and none out of reach. Where the wrist is straight (joints 4 and 6 about one line) joint 6 is at
/// `free_wrist`, rad, and joint 4 follows.
/// Accuracy  the flange is within 1e-9 m and rad of X_BT, except within 1e-6 rad of a straight elbow or wrist.
std::vector<Joints> inverse(const Dh& dh, const Eigen::Isometry3d& X_BT, double free_wrist = 0.0);

/// Returns the solution that is nearest to `seed`, by the largest difference of a joint, each joint turned by whole
/// turns where that brings it nearer and stays within `limit`, rad. Nothing if there is no solution.
std::optional<Joints> nearest(const std::vector<Joints>& solutions, const Joints& seed, double limit);

}  // namespace jostle::robot_bridge::ur
