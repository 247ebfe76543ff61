#pragma once
/// \file
/// The fine model F of one thread.

#include "physics_pool/local/dynamics.hpp"

namespace jostle::physics_pool {

/// Steps one world with all its physics. Owns the engine's scratch data; one
/// thread at a time. Nothing is allocated after construction.
class Simulator final : public Dynamics {
 public:
  explicit Simulator(WorldPtr world);

  const World& world() const override { return *world_; }
  double time_step() const override { return world_->time_step(); }

  Advance advance(State& x, std::span<const double> u, int engine_steps, const std::function<bool()>& interrupted = {},
                  const Disturbance& disturbance = {}) override;
  std::size_t bytes() const override;

  /// These do the same in parts, for worlds that are observed or disturbed while they
  /// move: begin once, then step as often as needed.
  void begin(const State& x, std::span<const double> u);
  void step();
  /// Adds the noise that belongs after engine step `step` under u.
  void disturb(const VelocityNoise& noise, const NoiseStream& stream, std::uint64_t step, std::span<const double> u);
  std::string divergence() const;
  void read(State& x) const;
  const StepFacts& facts() const { return facts_; }  ///< since begin()

 private:
  WorldPtr world_;
  DataPtr data_;
  StepFacts facts_;  // since begin()
};

/// What came of separate().
struct Separated {
  State x;
  double deepest = 0.0;  ///< m, deepest overlap that is left; above `depth` if the rounds did not suffice
};

/// Moves objects apart that overlap in x, as happens when a belief of shapes
/// meets a measurement of poses: steps the world with its velocities held at
/// zero until no two bodies are deeper in each other than `depth` metres, or
/// for `rounds` steps at most. The robot stays where it is. Cf. Eq. 6.9.
/// Error kInternal: the engine diverged.
Result<Separated> separate(const World& world, const State& x, double depth = 0.0005, int rounds = 200);

}  // namespace jostle::physics_pool
