#pragma once
/// \file
/// The world in which actions happen (Sec. 3.3): simulated, disturbed.

#include <cstdint>

#include "physics_pool/local/simulator.hpp"

namespace jostle::physics_pool {

/// Owns one moving world. With sigma = 0 an action of Delta_t ends bit-equal
/// to F of the planner. One thread at a time.
class ExecutionWorld {
 public:
  /// `velocity_sigma`: standard deviation of the noise of Eq. 3.3, added to
  /// every velocity of robot and objects after every engine step.
  ExecutionWorld(WorldPtr world, double velocity_sigma, std::uint64_t seed);

  /// Starts to apply u (m/s, rad/s) from the present state.
  void begin(std::span<const double> u);

  /// One engine step. Error kInternal if the engine diverged.
  Result<void> step();

  const World& world() const { return simulator_.world(); }
  const State& state() const { return state_; }
  double time() const { return steps_ * simulator_.world().time_step(); }  ///< s

 private:
  Simulator simulator_;
  double sigma_;
  std::uint64_t seed_;
  std::uint64_t steps_ = 0;
  State state_;
};

}  // namespace jostle::physics_pool
