#pragma once
/// \file
/// Poses: where a frame is, as plain numbers. transform.hpp turns them into transforms to calculate with.

#include <algorithm>
#include <array>
#include <cmath>

namespace jostle {

/// A Pose is X_AB: frame B in frame A.
struct Pose {
  std::array<double, 3> position{};               ///< p_AoBo_A, m
  std::array<double, 4> orientation{1, 0, 0, 0};  ///< R_AB as a unit quaternion w, x, y, z

  bool operator==(const Pose&) const = default;
};

/// Returns the quaternion w, x, y, z of a turn about z by `yaw` rad.
inline std::array<double, 4> turned_about_z(double yaw) { return {std::cos(yaw / 2), 0, 0, std::sin(yaw / 2)}; }

/// Returns the heading of a body's x axis, rad in (-pi, pi]. `q`: unit quaternion w, x, y, z.
inline double yaw_of(const double* q) {
  return std::atan2(2 * (q[0] * q[3] + q[1] * q[2]), 1 - 2 * (q[2] * q[2] + q[3] * q[3]));
}

/// Returns the z component of a body's z axis in the world: the cosine of its tilt.
inline double uprightness(const double* q) { return 1 - 2 * (q[1] * q[1] + q[2] * q[2]); }

/// Returns the angle of the rotation between two unit quaternions, rad in [0, pi].
inline double angle_between(const double* a, const double* b) {
  const double dot = std::abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]);
  return 2 * std::acos(std::min(dot, 1.0));
}

}  // namespace jostle
