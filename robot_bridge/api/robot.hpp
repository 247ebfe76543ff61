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
  double stamp = 0.0;     ///< when it was taken, s of the robot's clock: a simulation's, or the time of day
  std::vector<double> q;  ///< [joints] in the order of StateLayout::joints, m and rad
  std::vector<double> v;  ///< [joints] m/s and rad/s
  /// What the gripper itself says of an object between its fingers; empty for
  /// grippers that cannot tell.
  std::optional<bool> object_in_hand;
};

/// A robot that is controlled by the velocities of its axes, real or simulated: a planar gripper, a pusher, an arm.
///
/// An action is begun by start(), and is over when advance() says so. One is at work at a time.
///
/// Threads  one caller at a time.
/// Failure  the robot is stopped first, then the error is reported; no action is at work then.
/// Errors   kUnavailable  silent or gone; the message says since when
///          kInvalidArgument  a control that is not finite or of the wrong size, or an action is at work already
///          kCancelled    a stop was requested; the robot stands still
class Robot {
 public:
  virtual ~Robot() = default;

  /// Returns the newest state; waits until one is at hand that is younger than the last action that is over. While an
  /// action is at work, it is of a moment of that action.
  virtual Result<RobotReading> read(std::stop_token stop = {}) = 0;

  /// Begins to apply u ([nu], one velocity per axis in the order of the robot's model, m/s or rad/s) for
  /// `duration` seconds.
  virtual Result<void> start(std::span<const double> u, double duration, std::stop_token stop = {}) = 0;

  /// Lets a little time of the action at work go by, and returns whether it is over; true if none is at work. A stop
  /// request ends the action. Where time passes without us, an action goes on without calls; yet a robot that can do
  /// harm ends one whose caller neither advances nor reads for some hundredths of a second.
  virtual Result<bool> advance(std::stop_token stop = {}) = 0;

  /// Returns when the action at work is over.
  Result<void> wait(const std::stop_token& stop = {}) {
    for (;;) {
      const Result<bool> over = advance(stop);
      if (!over) return over.error();
      if (*over) return {};
    }
  }

  /// Starts an action, and returns when it is over.
  Result<void> execute(std::span<const double> u, double duration, const std::stop_token& stop = {}) {
    if (auto ok = start(u, duration, stop); !ok) return ok;
    return wait(stop);
  }
};

/// What start() answers while an action is at work.
inline Error action_at_work() {
  return {Code::kInvalidArgument, "robot: an action is at work already; wait for it, or stop it"};
}

}  // namespace jostle::robot_bridge
