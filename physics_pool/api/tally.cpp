#include "physics_pool/api/tally.hpp"

namespace jostle::physics_pool {

Tally::Tally(const TaskGeometry& geometry, const RolloutBatch& batch, const ControlSequence& controls,
             RolloutOutcome& outcome)
    : geometry_(geometry), batch_(batch), controls_(controls), outcome_(outcome), scorer_(batch.objective) {
  outcome_.trajectory.reserve(static_cast<std::size_t>(controls.steps()) + 1);
  outcome_.trajectory.push_back(batch.x0);
}

std::optional<End> Tally::count(const State& x, const StepFacts& facts) {
  const int t = steps();
  const auto u_before = t == 0 ? std::span<const double>(batch_.u_before) : controls_.step(t - 1);
  const double running = scorer_.running({.geometry = geometry_,
                                          .u_before = u_before,
                                          .u = controls_.step(t),
                                          .x0 = outcome_.trajectory.back(),
                                          .x1 = x,
                                          .facts = facts});
  sum_ += running;
  outcome_.step_costs.push_back(running);
  outcome_.facts.push_back(facts);
  outcome_.trajectory.push_back(x);

  const bool last = t + 1 == controls_.steps();
  const bool may_succeed = batch_.stop_on_success && t >= batch_.min_steps;
  if (!last && !may_succeed) return std::nullopt;
  const double goal = scorer_.final(geometry_, x);
  const bool succeeds = may_succeed && sum_ + goal <= batch_.objective.success_cost && scorer_.at_goal(geometry_, x);
  if (!last && !succeeds) return std::nullopt;
  sum_ += goal;
  outcome_.step_costs.back() += goal;
  return succeeds ? End::kSucceeded : End::kCompleted;
}

void Tally::close(End end) {
  outcome_.end = end;
  outcome_.steps = static_cast<std::uint32_t>(outcome_.step_costs.size());
  outcome_.at_goal = scorer_.at_goal(geometry_, outcome_.trajectory.back());
  if (end == End::kCompleted || end == End::kSucceeded) outcome_.cost = sum_;
  // Only a possible winner's states are worth their way.
  const bool may_win = end == End::kSucceeded || (end == End::kCompleted && sum_ < batch_.incumbent);
  if (!may_win && !batch_.want_all_trajectories) outcome_.trajectory.clear();
}

}  // namespace jostle::physics_pool
