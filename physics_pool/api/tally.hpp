#pragma once
/// \file
/// Tally: what a rollout costs, control step by control step.

#include <optional>

#include "physics_pool/api/rollout.hpp"
#include "physics_pool/objective/scorer.hpp"

namespace jostle::physics_pool {

/// Fills in the outcome of one rollout while its states become known, wherever they
/// come from:
///
///   J = phi(x[n]) + sum_t q(x[t], u[t])     lines 3-9 of Alg. 1
///
/// Everything given must outlive it.
class Tally {
 public:
  Tally(const TaskGeometry& geometry, const RolloutBatch& batch, const ControlSequence& controls,
        RolloutOutcome& outcome);

  /// Counts the next control step, which ended in x; `facts` say what happened during it. Returns how the rollout ends,
  /// if it ends there.
  std::optional<End> count(const State& x, const StepFacts& facts = {});

  /// Completes the outcome: cost and steps. The trajectory stays in it only if the rollout may win, or the batch wants
  /// all trajectories.
  void close(End end);

  double sum() const { return sum_; }                                         ///< so far
  int steps() const { return static_cast<int>(outcome_.step_costs.size()); }  ///< counted

 private:
  const TaskGeometry& geometry_;
  const RolloutBatch& batch_;
  const ControlSequence& controls_;
  RolloutOutcome& outcome_;
  Scorer scorer_;
  double sum_ = 0.0;
};

}  // namespace jostle::physics_pool
