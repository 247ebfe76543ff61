#pragma once
/// \file
/// Dynamics: what brings a state from one control step to the next.

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>

#include "idl/types/state.hpp"
#include "physics_pool/local/world.hpp"
#include "physics_pool/sampling/velocity_noise.hpp"

namespace jostle::physics_pool {

/// What came of an advance.
struct Advance {
  std::uint64_t engine_steps = 0;
  std::uint32_t thawed = 0;  ///< frozen objects that were touched and set free
  bool interrupted = false;
  StepFacts facts;       ///< over all its engine steps
  std::string diverged;  ///< empty, or why the state is of no use
};

/// The noise of one stretch of a rollout or of a world.
struct Disturbance {
  VelocityNoise noise;
  NoiseStream stream;
  std::uint64_t first_step = 0;  ///< engine steps done before
};

/// Computes x <- F(x, u), a pure function of its arguments: nothing of the engine's memory
/// reaches the next call, so a trajectory may be cut at any control step and
/// continued elsewhere. States are always those of the full world.
///
/// Threads  one at a time.
class Dynamics {
 public:
  virtual ~Dynamics() = default;

  virtual const World& world() const = 0;
  virtual double time_step() const = 0;  ///< s

  /// Runs `engine_steps` from x under u. `interrupted` is asked before each step;
  /// may be empty. After an interruption or a divergence x is of no use.
  /// `disturbance`: only the fine model may be given one (`validate` of batches sees to it).
  virtual Advance advance(State& x, std::span<const double> u, int engine_steps,
                          const std::function<bool()>& interrupted = {}, const Disturbance& disturbance = {}) = 0;

  /// Returns the memory it holds at present.
  virtual std::size_t bytes() const = 0;
};

}  // namespace jostle::physics_pool
