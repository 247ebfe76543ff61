#include "planners/pbsto/pbsto.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace jostle::planners {

using physics_pool::BatchReply;
using physics_pool::End;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;

// One call of plan(): the candidate and what improves it.
struct Pbsto::Run {
  const Pbsto& planner;
  const Problem& problem;
  TimePoint deadline;
  std::stop_token stop;
  Plan best;
  std::string divergence;  // reason of the newest rollout that diverged

  RolloutBatch batch(const ControlSequence& nominal) const {
    const PbstoOptions& options = planner.options_;
    RolloutBatch batch;
    batch.world = problem.world;
    batch.x0 = problem.x0;
    batch.nominal = nominal;
    batch.u_before.assign(static_cast<std::size_t>(nominal.nu), 0.0);
    batch.step_duration = options.step_duration;
    batch.law = {.sigma = options.sigma,
                 .limit = options.limit,
                 .scales = options.scales,
                 .seed = problem.seed};
    batch.objective = options.objective;
    if (!problem.clear_hand) batch.objective.obstruction = 0.0;
    batch.stop_on_success = true;
    batch.min_steps = options.min_steps;
    return batch;
  }

  // Scores one sequence as it is; the reply's winner, if any, beats the incumbent.
  Result<BatchReply> score(const ControlSequence& controls) {
    RolloutBatch one = batch(controls);
    std::ranges::fill(one.law.sigma, 0.0);
    one.incumbent = best.cost;
    one.stop_losers = planner.options_.stop_losers;
    ++best.rollouts;
    return run(one);
  }

  Result<BatchReply> run(const RolloutBatch& batch) {
    auto reply_result = planner.pool_.run(batch, deadline, stop);
    if (reply_result) {
      for (const RolloutOutcome& outcome : reply_result->outcomes) {
        if (outcome.end == End::kDiverged) divergence = outcome.reason;
      }
    }
    return reply_result;
  }

  void adopt(ControlSequence controls, const RolloutOutcome& outcome) {
    controls.truncate(static_cast<int>(outcome.steps));  // a success may come early
    best.controls = std::move(controls);
    best.states = outcome.trajectory;
    best.cost = outcome.cost;
    best.grasped = outcome.grasped && outcome.cost <= planner.options_.objective.success_cost;
  }

  // Scores a sequence and keeps it if it is better.
  Result<void> consider(const ControlSequence& controls) {
    auto reply_result = score(controls);
    if (!reply_result) return reply_result.error();
    if (reply_result->winner < 0) return {};
    const RolloutBatch one = batch(controls);
    physics_pool::SamplingLaw as_is = one.law;
    std::ranges::fill(as_is.sigma, 0.0);
    adopt(physics_pool::sample_controls(controls, as_is, 0),
          reply_result->outcomes[static_cast<std::size_t>(reply_result->winner)]);
    return {};
  }

  Result<void> iterate() {
    RolloutBatch noisy = batch(best.controls);
    noisy.samples = static_cast<std::uint32_t>(planner.options_.rollouts);
    noisy.law.stream = problem.stream + static_cast<std::uint32_t>(best.iterations);
    noisy.incumbent = best.cost;
    const bool weighted = planner.options_.update == PbstoOptions::Update::kCostWeighted;
    noisy.stop_losers = planner.options_.stop_losers && !weighted;  // weights need every cost
    auto reply_result = run(noisy);
    if (!reply_result) return reply_result.error();
    ++best.iterations;
    best.rollouts += noisy.samples;
    const BatchReply& reply = *reply_result;
    const bool succeeded =
        reply.winner >= 0 && reply.outcomes[static_cast<std::size_t>(reply.winner)].end == End::kSucceeded;
    if (weighted && !succeeded) return consider(weighted_mean(noisy, reply));
    if (reply.winner >= 0) {
      const RolloutOutcome& winner = reply.outcomes[static_cast<std::size_t>(reply.winner)];
      adopt(physics_pool::sample_controls(noisy.nominal, noisy.law, winner.sample), winner);
    }
    return {};
  }

  // Eq. 5.8: U*[t] = U[t] + sum_k exp(-C_k[t]/lambda)·dU_k[t] / sum_k exp(-C_k[t]/lambda).
  // The smallest cost of each step is subtracted first, which changes no weight
  // and keeps the largest at 1.
  ControlSequence weighted_mean(const RolloutBatch& noisy, const BatchReply& reply) const {
    const int steps = noisy.nominal.steps(), nu = noisy.nominal.nu;
    std::vector<ControlSequence> samples;
    std::vector<const RolloutOutcome*> outcomes;
    for (const RolloutOutcome& outcome : reply.outcomes) {
      if (outcome.end != End::kCompleted) continue;
      samples.push_back(physics_pool::sample_controls(noisy.nominal, noisy.law, outcome.sample));
      outcomes.push_back(&outcome);
    }
    ControlSequence mean = noisy.nominal;
    if (outcomes.empty()) return mean;
    for (int t = 0; t < steps; ++t) {
      const auto at = static_cast<std::size_t>(t);
      double least = physics_pool::kInfinity;
      for (const auto* outcome : outcomes) least = std::min(least, outcome->step_costs[at]);
      std::vector<double> sum(static_cast<std::size_t>(nu), 0.0);
      double total = 0.0;
      for (std::size_t k = 0; k < samples.size(); ++k) {
        const double weight = std::exp(-(outcomes[k]->step_costs[at] - least) / planner.options_.lambda);
        total += weight;
        for (int i = 0; i < nu; ++i) sum[i] += weight * samples[k].step(t)[i];
      }
      for (int i = 0; i < nu; ++i) mean.step(t)[i] = sum[i] / total;
    }
    return mean;
  }

  void report() const {
    if (!planner.on_progress_) return;
    planner.on_progress_({.iteration = best.iterations,
                          .cost = best.cost,
                          .grasped = best.grasped,
                          .rollouts = best.rollouts,
                          .final_state = best.states.empty() ? nullptr : &best.states.back()});
  }

  bool done() const {
    return best.iterations >= problem.iterations ||
           best.grasped;
  }
};

Pbsto::Pbsto(physics_pool::Pool& pool, PbstoOptions options, OnProgress on_progress)
    : pool_(pool), options_(std::move(options)), on_progress_(std::move(on_progress)) {}

Result<Plan> Pbsto::plan(const Problem& problem, TimePoint deadline, std::stop_token stop) {
  Run run{*this, problem, deadline, std::move(stop), {}};
  run.best.controls = problem.initial;
  run.best.states = {problem.x0};
  // Line 1 of Alg. 1.
  if (auto ok = run.consider(problem.initial); !ok) return ok.error();
  run.report();
  while (!run.done()) {
    if (auto ok = run.iterate(); !ok) return ok.error();
    run.report();
  }
  if (run.best.cost == physics_pool::kInfinity) {
    return Error{Code::kInvalidArgument,
                 fmt::format("x0: all {} rollouts from it diverged ({}), wanted a state that physics "
                             "can start from", run.best.rollouts, run.divergence)};
  }
  return std::move(run.best);
}

}  // namespace jostle::planners
