#pragma once
/// \file
/// Robot: the port through which plans become motion.

#include <optional>
#include <span>
#include <stop_token>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::robot_bridge {

/// One reading of the robot's own sensors.
struct RobotReading {
  std::vector<double> q;  ///< [joints] in the order of StateLayout::joints, m and rad
  std::vector<double> v;  ///< [joints] m/s and rad/s
  /// What the gripper itself says of an object between its fingers; empty for
  /// grippers that cannot tell.
  std::optional<bool> object_in_hand;
};

/// A robot that is controlled by the velocities of its axes, real or simulated: a planar gripper, a pusher, an arm.
///
/// Threads  one caller at a time.
/// Failure  the robot is stopped first, then the error is reported.
/// Errors   kUnavailable  silent or gone; the message says since when
///          kInvalidArgument  a control that is not finite or of the wrong size
///          kCancelled    a stop was requested; the robot stands still
class Robot {
 public:
  virtual ~Robot() = default;

  /// Returns the newest state; waits until one is at hand that is younger than the
  /// last executed control.
  virtual Result<RobotReading> read() = 0;

  /// Applies u ([nu], one velocity per axis in the order of the robot's model, m/s or rad/s) for
  /// `duration` seconds and returns when that time is over.
  virtual Result<void> execute(std::span<const double> u, double duration, std::stop_token stop = {}) = 0;
};

}  // namespace jostle::robot_bridge
