#pragma once
/// \file
/// Noise on velocities: how physics itself is uncertain.

#include <cstdint>

#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::physics_pool {

/// After every engine step every velocity of robot and objects gets a number from N(0, s^2), with
///
///   s = sigma + slope·|u|
///
/// where u is the control at work. Planners and execution worlds use the same value, so that they cannot drift apart.
/// Source   Eq. 3.3 (sigma) and 5.9, 5.10 (slope is b). Eq. 5.10 calls b·|u| a variance; taken as one it would be
///          7 cm/s per engine step at 0.1 m/s. Read as a standard deviation it is of the size of Eq. 3.3.
/// It is noise per engine step, so a value belongs to a length of that step.
struct VelocityNoise {
  double sigma = 0.0;  ///< m/s and rad/s, >= 0
  double slope = 0.0;  ///< b, >= 0; |u| is the robot's `control_norm`
  std::uint64_t seed = 0;

  bool is_off() const { return sigma == 0 && slope == 0; }

  bool operator==(const VelocityNoise&) const = default;
};

/// Says whose noise it is: with equal seeds a planner's world and the execution world still get independent numbers.
struct NoiseStream {
  Purpose purpose = Purpose::kPredictedNoise;
  std::uint32_t sample = 0;
};

/// Draws the standard normal number of one degree of freedom after engine step `step`, counted from the start of the
/// rollout or of the world.
double velocity_draw(const VelocityNoise& noise, const NoiseStream& stream, std::uint64_t step, int dof);

}  // namespace jostle::physics_pool
