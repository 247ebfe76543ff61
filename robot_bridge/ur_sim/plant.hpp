#pragma once
/// \file
/// Plant: what a simulated controller moves.

#include "idl/types/result.hpp"
#include "robot_bridge/ur/kinematics.hpp"

namespace jostle::robot_bridge::ur_sim {

using ur::Joints;

/// An arm with a gripper, and whatever they touch. One thread.
class Plant {
 public:
  virtual ~Plant() = default;

  /// Lets `duration` s go by while the drives turn the joints at `speeds`, rad/s, and open the gripper at
  /// `opening_rate`, m/s; negative closes. What is in the way may keep them from it. Error kInternal: the physics
  /// diverged.
  virtual Result<void> step(const Joints& speeds, double opening_rate, double duration) = 0;

  virtual Joints positions() const = 0;         ///< rad
  virtual Joints velocities() const = 0;        ///< rad/s
  virtual double opening() const = 0;           ///< m, between the fingertips
  virtual double opening_velocity() const = 0;  ///< m/s
};

}  // namespace jostle::robot_bridge::ur_sim
