#include "planners/adaptive/adaptive_planner.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "physics_pool/objective/catalogue.hpp"
#include "planners/adaptive/action_sequences.hpp"
#include "planners/search/search.hpp"

namespace jostle::planners {
namespace {

using physics_pool::BatchReply;
using physics_pool::End;
using physics_pool::kInfinity;
using physics_pool::Objective;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;

// One sequence, and what a rollout of it came to.
struct Candidate {
  ControlSequence controls;   // U
  Trajectory states;          // X
  std::vector<double> costs;  // C, by action; the last with the terminal costs
  double sum = kInfinity;     // of costs
  bool at_goal = false;
};

// L alone (Eq. 5.4): without what is paid once at the end.
Objective without_final_terms(Objective objective) {
  for (physics_pool::Term& term : objective.terms) {
    const physics_pool::TermKind* kind = physics_pool::find_term_kind(term.kind);
    if (kind && kind->final) term.weight = 0.0;
  }
  return objective;
}

class Decision {
 public:
  Decision(physics_pool::Pool& pool, const physics_pool::TaskGeometry& geometry, const PbstoOptions& optimizer,
           const AdaptiveOptions& options, const OnProgress& on_progress, const Problem& problem, TimePoint deadline,
           std::stop_token stop)
      : pool_(pool),
        geometry_(geometry),
        optimizer_(optimizer),
        options_(options),
        on_progress_(on_progress),
        problem_(problem),
        deadline_(deadline),
        stop_(std::move(stop)) {
    const bool warm = problem.initial.steps() > 0;
    for (ControlSequence& controls :
         action_sequences(geometry, problem.x0, options.least_actions, options.most_actions,
                          options.sequences - (warm ? 1 : 0), options.step_duration, optimizer.limit)) {
      candidates_.push_back({.controls = std::move(controls)});
    }
    if (warm) candidates_.push_back({.controls = problem.initial});
  }

  Result<Plan> make() {
    if (auto ok = roll_out(); !ok) return ok.error();
    report();
    for (; plan_.iterations < options_.iterations && plan_.rollouts < problem_.rollouts; ++plan_.iterations) {
      const std::vector<std::size_t> unfinished = improvable();
      if (unfinished.empty()) break;
      if (auto ok = improve(unfinished); !ok) return ok.error();
      report();
    }
    if (auto ok = judge(); !ok) return ok.error();
    if (plan_.choices[chosen_].value == kInfinity) {
      return Error{
          Code::kInvalidArgument,
          fmt::format("x0: all {} candidates from it diverged ({}), wanted a state that physics can start from",
                      candidates_.size(), divergence_)};
    }
    Candidate& best = candidates_[chosen_];
    plan_.chosen = static_cast<int>(chosen_);
    plan_.cost = plan_.choices[chosen_].value;
    plan_.controls = std::move(best.controls);
    plan_.states = std::move(best.states);
    plan_.at_goal = best.at_goal;
    return std::move(plan_);
  }

 private:
  // A batch of one rollout of these controls, as they are.
  RolloutBatch batch_of(const ControlSequence& controls) const {
    const std::vector<double> none(static_cast<std::size_t>(geometry_.layout.nu), 0.0);
    RolloutBatch batch{.world = problem_.world, .x0 = problem_.x0, .nominal = controls};
    batch.u_before = problem_.u_before.empty() ? none : problem_.u_before;
    batch.step_duration = options_.step_duration;
    batch.rest = options_.rest;
    batch.law = {.sigma = none, .limit = optimizer_.limit, .seed = problem_.seed};
    batch.objective = problem_.objective;
    batch.priority = problem_.priority;
    return batch;
  }

  Result<std::vector<BatchReply>> run(const std::vector<RolloutBatch>& batches) {
    if (std::chrono::steady_clock::now() >= deadline_) return Error{Code::kDeadline, "plan: out of time"};
    for (const RolloutBatch& batch : batches) {
      plan_.rollouts += batch.samples;
      if (problem_.rollouts_asked_for) *problem_.rollouts_asked_for += batch.samples;
    }
    auto replies_result = pool_.run_all(batches, deadline_, stop_);
    if (!replies_result) return replies_result;
    for (const BatchReply& reply : *replies_result) {
      for (const RolloutOutcome& outcome : reply.outcomes) {
        if (outcome.end == End::kDiverged) divergence_ = outcome.reason;
      }
    }
    return replies_result;
  }

  // Line 9 of Alg. 9, where the batch's incumbent is the candidate's own cost.
  static void adopt(Candidate& candidate, const RolloutBatch& batch, const BatchReply& reply) {
    const RolloutOutcome* winner = winner_of(reply);
    if (!winner) return;
    candidate.controls = physics_pool::sample_controls(batch.nominal, batch.law, winner->sample);
    candidate.states = winner->trajectory;
    candidate.costs = winner->step_costs;
    candidate.sum = winner->cost;
    candidate.at_goal = winner->at_goal;
  }

  // Line 1 of Alg. 9, for all candidates side by side.
  Result<void> roll_out() {
    std::vector<RolloutBatch> batches;
    for (const Candidate& candidate : candidates_) batches.push_back(batch_of(candidate.controls));
    auto replies_result = run(batches);
    if (!replies_result) return replies_result.error();
    for (std::size_t i = 0; i < batches.size(); ++i) adopt(candidates_[i], batches[i], (*replies_result)[i]);
    return {};
  }

  std::vector<std::size_t> improvable() const {
    const double per_action = problem_.objective.weight("action");
    std::vector<std::size_t> found;
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      const double avoidable = candidates_[i].sum - per_action * candidates_[i].controls.steps();
      if (avoidable > problem_.objective.success_cost) found.push_back(i);
    }
    return found;
  }

  // Lines 3 to 10 of Alg. 9.
  Result<void> improve(const std::vector<std::size_t>& which) {
    const bool weighted = optimizer_.update == PbstoOptions::Update::kCostWeighted;
    std::vector<RolloutBatch> batches;
    for (const std::size_t i : which) {
      RolloutBatch noisy = batch_of(candidates_[i].controls);
      noisy.samples = static_cast<std::uint32_t>(optimizer_.rollouts);
      // Candidates that begin alike must not get the same noise: they would stay alike.
      noisy.first_sample = static_cast<std::uint32_t>(i) * noisy.samples;
      noisy.law.sigma = optimizer_.sigma;
      noisy.law.scales = optimizer_.scales;
      noisy.law.persistence = optimizer_.persistence;
      noisy.law.stream =
          (problem_.stream + static_cast<std::uint32_t>(plan_.iterations)) % physics_pool::kSamplingStreams;
      noisy.incumbent = candidates_[i].sum;
      noisy.stop_losers = optimizer_.stop_losers && !weighted;  // weights need every cost
      batches.push_back(std::move(noisy));
    }
    auto replies_result = run(batches);
    if (!replies_result) return replies_result.error();
    if (weighted) return adopt_means(which, batches, *replies_result);
    for (std::size_t b = 0; b < which.size(); ++b) adopt(candidates_[which[b]], batches[b], (*replies_result)[b]);
    return {};
  }

  // Eq. 5.8, and line 8 of Alg. 9.
  Result<void> adopt_means(const std::vector<std::size_t>& which, const std::vector<RolloutBatch>& noisy,
                           const std::vector<BatchReply>& replies) {
    std::vector<std::size_t> places;
    std::vector<RolloutBatch> means;
    for (std::size_t b = 0; b < which.size(); ++b) {
      const std::vector<Scored> samples = completed(noisy[b], replies[b]);
      if (samples.empty()) continue;  // every one diverged; the next draws may not
      ControlSequence mean = noisy[b].nominal;
      std::vector<double> costs(samples.size());
      for (int t = 0; t < mean.steps(); ++t) {
        for (std::size_t k = 0; k < samples.size(); ++k) costs[k] = samples[k].step_costs[static_cast<std::size_t>(t)];
        average_step(samples, exponential_weights(costs, optimizer_.lambda), t, mean);
      }
      places.push_back(which[b]);
      means.push_back(batch_of(mean));
      means.back().incumbent = candidates_[which[b]].sum;
    }
    if (means.empty()) return {};
    auto replies_result = run(means);
    if (!replies_result) return replies_result.error();
    for (std::size_t b = 0; b < places.size(); ++b) adopt(candidates_[places[b]], means[b], (*replies_result)[b]);
    return {};
  }

  // Lines 5 to 11 of Alg. 6.
  Result<void> judge() {
    for (const Candidate& candidate : candidates_) {
      plan_.choices.push_back({.actions = candidate.controls.steps(),
                               .speed = speed(candidate.controls),
                               .value = candidate.sum,
                               .spread = 0.0});
    }
    if (options_.samples > 0) {
      if (auto ok = judge_under_noise(); !ok) return ok;
    }
    const auto least = std::ranges::min_element(plan_.choices, {}, &Choice::value);
    chosen_ = static_cast<std::size_t>(least - plan_.choices.begin());
    return {};
  }

  Result<void> judge_under_noise() {
    const Objective running = without_final_terms(problem_.objective);
    const bool printed = options_.value == AdaptiveOptions::Value::kPrinted;
    std::vector<RolloutBatch> batches;
    std::vector<std::size_t> judged;
    for (std::size_t i = 0; i < candidates_.size(); ++i) {
      if (candidates_[i].sum == kInfinity) continue;
      ControlSequence first = candidates_[i].controls;
      first.truncate(1);
      RolloutBatch batch = batch_of(first);
      batch.samples = static_cast<std::uint32_t>(options_.samples);
      // The same for all candidates, others for each decision.
      batch.first_sample = problem_.stream * batch.samples;
      batch.stop_losers = false;
      batch.noise = {.slope = options_.noise, .seed = problem_.seed};
      if (printed || candidates_[i].controls.steps() > 1) batch.objective = running;
      batches.push_back(std::move(batch));
      judged.push_back(i);
    }
    if (batches.empty()) return {};
    auto replies_result = run(batches);
    if (!replies_result) return replies_result.error();
    for (std::size_t b = 0; b < judged.size(); ++b) {
      const std::vector<double>& costs = candidates_[judged[b]].costs;
      const double rest = std::accumulate(costs.begin() + (printed ? 0 : 1), costs.end(), 0.0);  // V~
      std::vector<double> values;
      for (const RolloutOutcome& outcome : (*replies_result)[b].outcomes) values.push_back(outcome.cost + rest);
      const double mean = std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
      double square = 0.0;
      for (const double value : values) square += (value - mean) * (value - mean);
      plan_.choices[judged[b]].value = std::isfinite(mean) ? mean : kInfinity;
      plan_.choices[judged[b]].spread =
          std::isfinite(mean) ? std::sqrt(square / static_cast<double>(values.size())) : 0.0;
    }
    return {};
  }

  // Of the robot in the plane, in the first action.
  double speed(const ControlSequence& controls) const {
    const auto u = controls.step(0);
    return std::hypot(u[static_cast<std::size_t>(geometry_.planar->x)],
                      u[static_cast<std::size_t>(geometry_.planar->y)]);
  }

  void report() const {
    if (!on_progress_) return;
    const auto best = std::ranges::min_element(candidates_, {}, &Candidate::sum);
    on_progress_({.iteration = plan_.iterations,
                  .cost = best->sum,
                  .at_goal = best->at_goal,
                  .rollouts = plan_.rollouts,
                  .final_state = best->states.empty() ? nullptr : &best->states.back()});
  }

  physics_pool::Pool& pool_;
  const physics_pool::TaskGeometry& geometry_;
  const PbstoOptions& optimizer_;
  const AdaptiveOptions& options_;
  const OnProgress& on_progress_;
  const Problem& problem_;
  const TimePoint deadline_;
  const std::stop_token stop_;
  std::vector<Candidate> candidates_;
  std::size_t chosen_ = 0;
  Plan plan_;
  std::string divergence_;  // reason of the newest rollout that diverged
};

}  // namespace

AdaptivePlanner::AdaptivePlanner(physics_pool::Pool& pool, const physics_pool::TaskGeometry& geometry,
                                 PbstoOptions optimizer, AdaptiveOptions options, OnProgress on_progress)
    : pool_(pool),
      geometry_(geometry),
      optimizer_(std::move(optimizer)),
      options_(options),
      on_progress_(std::move(on_progress)) {}

Result<Plan> AdaptivePlanner::plan(const Problem& problem, TimePoint deadline, std::stop_token stop) {
  return Decision(pool_, geometry_, optimizer_, options_, on_progress_, problem, deadline, std::move(stop)).make();
}

}  // namespace jostle::planners
