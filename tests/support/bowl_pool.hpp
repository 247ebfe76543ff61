#pragma once
/// \file
/// A Pool without physics: every control step costs its squared distance from a
/// wanted control, so that optima and averages are known in closed form.

#include <functional>
#include <numeric>
#include <optional>
#include <vector>

#include "physics_pool/api/pool.hpp"
#include "planners/api/planner.hpp"

namespace jostle::tests {

/// Scores samples by sum_t scale·|u_t - wanted|^2. The trajectory integrates the
/// controls into q. Keeps every batch it was given. One thread at a time.
class BowlPool final : public physics_pool::Pool {
 public:
  explicit BowlPool(std::vector<double> wanted) : wanted_(std::move(wanted)) {}

  Result<Hash> load(const physics_pool::Scene& scene) override { return scene_hash(scene); }

  Result<physics_pool::BatchReply> run(const physics_pool::RolloutBatch& batch, physics_pool::TimePoint deadline,
                                       std::stop_token stop = {}) override {
    batches.push_back(batch);
    deadlines.push_back(deadline);
    if (stop.stop_requested()) return Error{Code::kCancelled, "bowl: cancelled"};
    if (fail_at && batches.size() > *fail_at) return Error{fail_code, "bowl: told to fail"};
    if (auto ok = validate(batch); !ok) return ok.error();
    physics_pool::BatchReply reply;
    for (std::uint32_t i = 0; i < batch.samples; ++i) {
      reply.outcomes.push_back(score(batch, batch.first_sample + i));
    }
    reply.winner = select_winner(reply.outcomes, batch.incumbent);
    return reply;
  }

  physics_pool::PoolStatus status() const override { return {}; }

  std::vector<double> step_costs(const ControlSequence& controls) const {
    std::vector<double> costs;
    for (int t = 0; t < controls.steps(); ++t) {
      double sum = 0.0;
      for (std::size_t i = 0; i < wanted_.size(); ++i) {
        const double d = controls.step(t)[i] - wanted_[i];
        sum += d * d;
      }
      costs.push_back(scale * sum);
    }
    return costs;
  }

  double cost(const ControlSequence& controls) const {
    const std::vector<double> costs = step_costs(controls);
    return std::accumulate(costs.begin(), costs.end(), 0.0);
  }

  double scale = 1000.0;
  bool can_succeed = false;            ///< success where the total is at most the objective's
  std::optional<int> success_steps;    ///< after which a success ends; else all
  std::optional<std::size_t> fail_at;  ///< batches that go well before errors begin
  Code fail_code = Code::kUnavailable;
  std::function<bool(const physics_pool::RolloutBatch&, std::uint32_t)> diverges;
  std::function<double(const physics_pool::RolloutBatch&)> extra;  ///< cost on top, in the last step

  std::vector<physics_pool::RolloutBatch> batches;
  std::vector<physics_pool::TimePoint> deadlines;

 private:
  physics_pool::RolloutOutcome score(const physics_pool::RolloutBatch& batch, std::uint32_t sample) const {
    using physics_pool::End;
    if (diverges && diverges(batch, sample)) {
      return {.sample = sample, .end = End::kDiverged, .reason = "told to diverge"};
    }
    const ControlSequence controls = sample_controls(batch.nominal, batch.law, sample);
    physics_pool::RolloutOutcome outcome{.sample = sample, .end = End::kCompleted};
    outcome.step_costs = step_costs(controls);
    outcome.steps = static_cast<std::uint32_t>(controls.steps());
    if (extra && !outcome.step_costs.empty()) outcome.step_costs.back() += extra(batch);
    outcome.cost = std::accumulate(outcome.step_costs.begin(), outcome.step_costs.end(), 0.0);
    State x = batch.x0;
    outcome.trajectory.push_back(x);
    for (int t = 0; t < controls.steps(); ++t) {
      for (std::size_t i = 0; i < x.q.size() && i < wanted_.size(); ++i) x.q[i] += controls.step(t)[i];
      outcome.trajectory.push_back(x);
    }
    if (can_succeed && batch.stop_on_success && outcome.cost <= batch.objective.success_cost) {
      outcome.end = End::kSucceeded;
      outcome.at_goal = true;
      if (success_steps) {
        outcome.steps = static_cast<std::uint32_t>(*success_steps);
        outcome.step_costs.resize(outcome.steps);
        outcome.trajectory.resize(outcome.steps + 1);
      }
    }
    return outcome;
  }

  std::vector<double> wanted_;
};

/// Three steps that start from standing still, for a planner of the bowl.
inline planners::Problem bowl_problem(int iterations) {
  planners::Problem problem;
  problem.world = hash_of("bowl");
  problem.x0 = {.q = std::vector<double>(12, 0.0), .v = std::vector<double>(11, 0.0)};
  problem.initial = {.nu = 4, .values = std::vector<double>(12, 0.0)};
  problem.iterations = iterations;
  problem.seed = 42;
  problem.stream = 7;
  return problem;
}

}  // namespace jostle::tests
