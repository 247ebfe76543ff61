#pragma once
/// \file
/// What coarse physics says of a candidate.

#include <limits>
#include <span>

#include "idl/types/state.hpp"
#include "physics_pool/coarse/quasi_static_clutter.hpp"
#include "physics_pool/objective/scorer.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::planners {

/// A guess, which ranks and decides nothing.
struct Forecast {
  double cost = std::numeric_limits<double>::infinity();  ///< as a rollout's; of one that drops something, so far
  bool succeeds = false;                                  ///< at the goal, early or at its end, and not too dear
  int lodged = 0;                                         ///< other objects in the hand at the end
  int steps = 0;                                          ///< until its success, or its end

  /// Lower is better. The objective alone is a trap: what lodges between palm and target pushes it ahead of the hand,
  /// for less than any way round costs, and never comes to an end. So a success comes first, and what lodges counts
  /// here whatever the objective says of it.
  double rank() const;
};

/// What a rollout is scored by.
struct ForecastProblem {
  const physics_pool::TaskGeometry& geometry;
  const physics_pool::Objective& objective;
  double step_duration = 1.0;  ///< s
  int min_steps = 2;           ///< n_min
};

/// Rolls candidates out in coarse physics: one thread's model and memory.
class Forecaster {
 public:
  explicit Forecaster(physics_pool::QuasiStaticClutter model) : model_(std::move(model)) {}

  /// Sets what is assumed of friction from now on.
  void assume(const physics_pool::ClutterOptions& options) { model_.set_options(options); }

  /// Forecasts controls[first..n) from x, which is what controls[0..first) led to at the cost `so_far`.
  /// `u_before`: control before step `first`.
  Forecast run(const ForecastProblem& problem, const physics_pool::Scorer& scorer, const State& x,
               std::span<const double> u_before, const ControlSequence& controls, int first = 0, double so_far = 0.0);

 private:
  physics_pool::QuasiStaticClutter model_;
  State before_, after_;
};

}  // namespace jostle::planners
