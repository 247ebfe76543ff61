#pragma once
/// \file
/// PoseFilter: what a sequence of measurements says of one object's pose and motion.

#include <Eigen/Core>
#include <Eigen/Geometry>

namespace jostle::perception {

using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;
using Vector12d = Eigen::Matrix<double, 12, 1>;
using Matrix12d = Eigen::Matrix<double, 12, 12>;

/// How objects move that lie on a table and are pushed now and then.
struct MotionModel {
  double speed = 0.1;            ///< m/s, standard deviation of each component while it moves; more follows sooner
  double turning = 0.7;          ///< rad/s, the same of rotation
  double persistence = 1.0;      ///< s, for which velocities stay much the same
  double rest_lasts = 5.0;       ///< s, mean
  double motion_lasts = 4.0;     ///< s, mean
  double creep = 0.0003;         ///< m after 1 s, standard deviation of each component at rest; grows as sqrt(t)
  double turning_creep = 0.003;  ///< rad, the same of rotation
};

/// A pose as it was measured, or is known.
struct PoseBelief {
  Eigen::Vector3d p{0, 0, 0};                  ///< p_WoBo_W, m
  Eigen::Quaterniond R{1, 0, 0, 0};            ///< R_WB
  Matrix6d covariance = Matrix6d::Identity();  ///< of (translation, rotation vector), world axes
};

/// Returns how far b is from a as a (translation, m; rotation vector, rad) in world axes: R_b = exp(rotation) R_a.
Vector6d difference(const PoseBelief& a, const PoseBelief& b);

/// An object rests or moves, and changes between both at random: two Kalman filters side by side, whose states are
/// mixed as likely as it changed (Blom and Bar-Shalom, "The Interacting Multiple Model Algorithm", IEEE TAC 1988). At
/// rest the pose creeps; in motion velocities are Ornstein-Uhlenbeck processes. Errors of rotations are vectors in the
/// tangent space at the mean, so the means stay rotations.
///
/// Threads  a value; one at a time.
class PoseFilter {
 public:
  /// Begins where it is measured first, likely at rest.
  PoseFilter(const PoseBelief& measured, const MotionModel& model);

  /// Lets time pass, s >= 0.
  void predict(double dt);

  /// Returns the squared Mahalanobis distance of a measurement, 6 degrees of freedom, from where it is expected: at
  /// rest or in motion, whichever is nearer.
  double distance(const PoseBelief& measured) const;

  /// Takes a measurement, and returns the logarithm of its likelihood.
  double update(const PoseBelief& measured);

  PoseBelief pose() const;          ///< mean and covariance over both
  Eigen::Vector3d linear() const;   ///< m/s, world axes; 0 at rest
  Eigen::Vector3d angular() const;  ///< rad/s, world axes; 0 at rest
  bool rests() const { return rest_share_ > 0.5; }

 private:
  struct Moving {
    PoseBelief pose;  // whose covariance is not used: the one below is of all
    Eigen::Vector3d v{0, 0, 0}, w{0, 0, 0};
    Matrix12d covariance = Matrix12d::Zero();  // translation, rotation, v, w
  };

  Moving moving_from_rest() const;
  void mix(double dt);

  MotionModel model_;
  PoseBelief still_;
  Moving moving_;
  double rest_share_ = 0.8;  // probability that it rests
};

}  // namespace jostle::perception
