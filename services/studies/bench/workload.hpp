#pragma once
/// \file
/// What is simulated to be measured, and the barest way to simulate it.

#include <chrono>
#include <memory>
#include <vector>

#include "physics_pool/api/pool.hpp"
#include "physics_pool/local/simulator.hpp"
#include "services/studies/bench/measurement.hpp"

namespace jostle::studies {

/// Generates a scene of Sec. 3.3.1 with this many objects beside the target.
Result<physics_pool::Scene> clutter(int objects);

/// Makes a straight push of `steps` control steps into the scene, and noisy samples
/// of it that all run to their ends.
physics_pool::RolloutBatch push(const physics_pool::Scene& scene, int steps, double step_duration,
                                std::uint32_t samples);

/// Hashes states, in order, bit for bit.
Hash hash_of_states(const std::vector<State>& states);

/// Hashes every outcome's last state, in sample order; a rollout without one (it
/// diverged) leaves a gap that no bare loop has.
Hash hash_of_last_states(const physics_pool::BatchReply& reply);

/// Hashes every outcome's sample, end and cost.
Hash hash_of_answers(const std::vector<physics_pool::RolloutOutcome>& outcomes);

/// Times one batch through a pool, in engine steps per second.
Result<Sample> time_steps(physics_pool::Pool& pool, const physics_pool::RolloutBatch& batch, std::stop_token stop);

/// BareLoops are the yardstick: threads that do nothing but make a sample's controls, inject
/// its first state and step the engine. They take the next sample from a counter,
/// as a pool's threads take theirs from a queue, so that a long rollout costs
/// both sides the same. `Simulator::begin` and `step` are mj_step and the few
/// assignments it needs; engine headers stay in physics_pool.
class BareLoops {
 public:
  BareLoops(const physics_pool::WorldPtr& world, int threads);

  /// Returns engine steps per second, and the hash of all last states. Throws what the
  /// engine does when a rollout diverges beyond repair.
  Sample run(const physics_pool::RolloutBatch& batch);

 private:
  std::vector<std::unique_ptr<physics_pool::Simulator>> simulators_;  // one per thread
};

/// Returns the seconds since an earlier moment.
inline double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace jostle::studies
