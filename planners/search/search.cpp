#include "planners/search/search.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>
#include <thread>

namespace jostle::planners {

using physics_pool::BatchReply;
using physics_pool::End;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;

Search::Search(physics_pool::Pool& pool, const Problem& problem, RolloutBatch pattern, TimePoint deadline,
               std::stop_token stop, const OnProgress& on_progress)
    : pool_(pool),
      problem_(problem),
      pattern_(std::move(pattern)),
      deadline_(deadline),
      stop_(std::move(stop)),
      on_progress_(on_progress) {
  pattern_.world = problem.world;
  pattern_.x0 = problem.x0;
  pattern_.u_before = problem.u_before;
  if (problem.u_before.empty()) pattern_.u_before.assign(static_cast<std::size_t>(problem.initial.nu), 0.0);
  pattern_.law.seed = problem.seed;
  pattern_.objective = problem.objective;
  pattern_.stop_on_success = true;
  pattern_.priority = problem.priority;
  best_.controls = problem.initial;
  best_.states = {problem.x0};
}

RolloutBatch Search::around(const ControlSequence& nominal) const {
  RolloutBatch batch = pattern_;
  batch.nominal = nominal;
  batch.law.stream = (problem_.stream + static_cast<std::uint32_t>(best_.iterations)) % physics_pool::kSamplingStreams;
  batch.incumbent = best_.cost;
  return batch;
}

Result<BatchReply> Search::run(const RolloutBatch& batch) {
  // A pool may be done before it looks at the time.
  if (std::chrono::steady_clock::now() >= deadline_) return Error{Code::kDeadline, "plan: out of time"};
  best_.rollouts += batch.samples;
  if (problem_.rollouts_asked_for) *problem_.rollouts_asked_for += batch.samples;
  auto reply_result = pool_.run(batch, deadline_, stop_);
  if (!reply_result) return reply_result;
  for (const RolloutOutcome& outcome : reply_result->outcomes) {
    if (outcome.end == End::kDiverged) divergence_ = outcome.reason;
  }
  return reply_result;
}

Result<std::vector<BatchReply>> Search::run_in_order(std::span<const RolloutBatch> batches) {
  if (std::chrono::steady_clock::now() >= deadline_) return Error{Code::kDeadline, "plan: out of time"};
  for (const RolloutBatch& batch : batches) {
    best_.rollouts += batch.samples;
    if (problem_.rollouts_asked_for) *problem_.rollouts_asked_for += batch.samples;
  }
  std::vector<std::stop_source> stops(batches.size());
  std::vector<std::optional<Result<BatchReply>>> results(batches.size());
  const auto stop_from = [&stops](std::size_t first) {
    for (std::size_t i = first; i < stops.size(); ++i) stops[i].request_stop();
  };
  {
    const std::stop_callback on_stop(stop_, [&] { stop_from(0); });
    std::vector<std::jthread> waiting;
    for (std::size_t i = 0; i < batches.size(); ++i) {
      waiting.emplace_back([&, i] {
        results[i] = pool_.run(batches[i], deadline_, stops[i].get_token());
        if (!*results[i] || is_enough(**results[i])) stop_from(i + 1);
      });
    }
  }
  std::vector<BatchReply> replies(batches.size());
  for (std::size_t i = 0; i < batches.size(); ++i) {
    if (!*results[i]) return results[i]->error();
    replies[i] = std::move(*results[i]).value();
    for (const RolloutOutcome& outcome : replies[i].outcomes) {
      if (outcome.end == End::kDiverged) divergence_ = outcome.reason;
    }
    if (is_enough(replies[i])) break;
  }
  return replies;
}

bool Search::is_enough(const BatchReply& reply) const {
  const RolloutOutcome* winner = winner_of(reply);
  return winner && winner->at_goal && winner->cost <= pattern_.objective.success_cost;
}

void Search::adopt(const RolloutBatch& batch, const BatchReply& reply) {
  const RolloutOutcome* winner = winner_of(reply);
  if (!winner) return;
  best_.controls = physics_pool::sample_controls(batch.nominal, batch.law, winner->sample);
  // A success may come early; one of reduced physics may have to go on.
  if (batch.fidelity == physics_pool::Fidelity{}) best_.controls.truncate(static_cast<int>(winner->steps));
  best_.states = winner->trajectory;
  best_.cost = winner->cost;
  best_.at_goal = is_enough(reply);
}

Result<void> Search::consider(const ControlSequence& controls) {
  RolloutBatch one = around(controls);
  std::ranges::fill(one.law.sigma, 0.0);
  auto reply_result = run(one);
  if (!reply_result) return reply_result.error();
  adopt(one, *reply_result);
  return {};
}

Result<void> Search::attempt(const std::function<Result<void>()>& step) {
  Plan before = best_;
  if (auto ok = step(); !ok) return ok;
  if (!best_.at_goal || pattern_.fidelity == physics_pool::Fidelity{}) return {};
  RolloutBatch full = around(best_.controls);
  std::ranges::fill(full.law.sigma, 0.0);
  full.fidelity = {};
  full.incumbent = physics_pool::kInfinity;
  auto reply_result = run(full);
  if (!reply_result) return reply_result.error();
  const RolloutOutcome* truth = winner_of(*reply_result);
  if (!truth || truth->end != End::kSucceeded) ++best_.denials, ++before.denials;
  if (truth && (truth->end == End::kSucceeded || truth->cost < before.cost)) {
    adopt(full, *reply_result);
  } else {
    before.rollouts = best_.rollouts;
    best_ = std::move(before);
  }
  return {};
}

Result<Plan> Search::until_done(const std::function<Result<void>()>& improve) {
  if (auto ok = attempt([this] { return consider(problem_.initial); }); !ok) return ok.error();
  report();
  return improve_until_done(improve);
}

Result<Plan> Search::improve_until_done(const std::function<Result<void>()>& improve) {
  while (best_.iterations < problem_.iterations && best_.rollouts < problem_.rollouts && !best_.at_goal) {
    if (auto ok = attempt(improve); !ok) return ok.error();
    ++best_.iterations;
    report();
  }
  if (best_.cost == physics_pool::kInfinity) {
    return Error{Code::kInvalidArgument,
                 fmt::format("x0: all {} rollouts from it diverged ({}), wanted a state that physics "
                             "can start from",
                             best_.rollouts, divergence_)};
  }
  return std::move(best_);
}

void Search::report() const {
  if (!on_progress_) return;
  on_progress_({.iteration = best_.iterations,
                .cost = best_.cost,
                .at_goal = best_.at_goal,
                .rollouts = best_.rollouts,
                .final_state = best_.states.empty() ? nullptr : &best_.states.back()});
}

const RolloutOutcome* winner_of(const BatchReply& reply) {
  return reply.winner < 0 ? nullptr : &reply.outcomes[static_cast<std::size_t>(reply.winner)];
}

bool succeeded(const BatchReply& reply) {
  const RolloutOutcome* winner = winner_of(reply);
  return winner && winner->end == End::kSucceeded;
}

std::vector<Scored> completed(const RolloutBatch& batch, const BatchReply& reply) {
  std::vector<Scored> samples;
  for (const RolloutOutcome& outcome : reply.outcomes) {
    if (outcome.end != End::kCompleted) continue;
    samples.push_back({.controls = physics_pool::sample_controls(batch.nominal, batch.law, outcome.sample),
                       .cost = outcome.cost,
                       .step_costs = outcome.step_costs});
  }
  return samples;
}

std::vector<double> exponential_weights(const std::vector<double>& costs, double lambda) {
  std::vector<double> weights = costs;
  const double least = costs.empty() ? 0.0 : *std::ranges::min_element(costs);
  for (double& weight : weights) weight = std::exp(-(weight - least) / lambda);
  return weights;
}

void average_step(std::span<const Scored> samples, std::span<const double> weights, int t, ControlSequence& mean) {
  const std::span<double> u = mean.step(t);
  std::ranges::fill(u, 0.0);
  double total = 0.0;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    total += weights[k];
    for (std::size_t i = 0; i < u.size(); ++i) u[i] += weights[k] * samples[k].controls.step(t)[i];
  }
  for (double& value : u) value /= total;
}

}  // namespace jostle::planners
