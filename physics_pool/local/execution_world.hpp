#pragma once
/// \file
/// The world in which actions happen (Sec. 3.3): simulated, disturbed.

#include <cstdint>
#include <span>
#include <vector>

#include "physics_pool/local/simulator.hpp"

namespace jostle::physics_pool {

/// Owns one moving world. Without noise an action of Delta_t ends bit-equal
/// to F of the planner. One thread at a time.
class ExecutionWorld {
 public:
  explicit ExecutionWorld(WorldPtr world, const VelocityNoise& noise = {});

  /// Starts to apply u (m/s, rad/s) from the present state.
  void begin(std::span<const double> u);

  /// Makes one engine step. Error kInternal if the engine diverged.
  Result<void> step();

  const World& world() const { return simulator_.world(); }
  const State& state() const { return state_; }
  double time() const { return steps_ * simulator_.world().time_step(); }  ///< s

 private:
  static constexpr NoiseStream kStream{.purpose = Purpose::kExecutedNoise};

  Simulator simulator_;
  VelocityNoise noise_;
  std::vector<double> u_;  // at work
  std::uint64_t steps_ = 0;
  State state_;
};

}  // namespace jostle::physics_pool
