#include "planners/robustness/robust_sto.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <tuple>

#include "physics_pool/objective/scorer.hpp"
#include "planners/robustness/divergence.hpp"

namespace jostle::planners {
namespace {

using physics_pool::BatchReply;
using physics_pool::End;
using physics_pool::kInfinity;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;
using physics_pool::Scene;

constexpr double kMoved = 0.001;  // m

// A world that the real one may be, and the states in which it may begin.
struct World {
  Hash hash;
  std::vector<double> lifts;  // [objects] m, how much higher objects stand than in the planning world
  std::vector<State> starts;  // [N_c]
};

struct Candidate {
  ControlSequence controls;        // U
  Trajectory states;               // X, from x0 in the planning world
  double cost = kInfinity;         // J
  double robust_cost = kInfinity;  // J_R
  bool at_goal = false;
  bool is_feasible = false;
  std::vector<Deviations> worlds;  // [N_w + 1][N_c][N + 1]; empty where robustness is left out
  double expected = 0.0;           // E_e^r

  // Where a trajectory breaks in some world J_R is infinite; then J decides.
  bool is_better_than(const Candidate& other) const {
    return std::tuple(robust_cost, cost) < std::tuple(other.robust_cost, other.cost);
  }
};

class Optimization {
 public:
  Optimization(physics_pool::Pool& pool, const Scene& scene, const physics_pool::TaskGeometry& geometry,
               const PbstoOptions& optimizer, const RobustStoOptions& options, const OnProgress& on_progress,
               const Problem& problem, TimePoint deadline, std::stop_token stop)
      : pool_(pool),
        scene_(scene),
        geometry_(geometry),
        optimizer_(optimizer),
        options_(options),
        on_progress_(on_progress),
        problem_(problem),
        deadline_(deadline),
        stop_(std::move(stop)),
        scorer_(problem.objective),
        is_weighing_(problem.weigh_robustness && options.starts > 0) {}

  Result<Plan> make() {
    if (is_weighing_) {
      if (auto ok = draw_worlds(); !ok) return ok.error();
    }
    // Lines 1 to 3.
    const std::vector<double> still(optimizer_.sigma.size(), 0.0);
    auto first_result = rolled_out(problem_.initial, still, 1);
    if (!first_result) return first_result.error();
    best_ = std::move(first_result->front());
    report();
    for (; plan_.iterations < problem_.iterations && plan_.rollouts < problem_.rollouts && !is_done();
         ++plan_.iterations, report()) {
      auto samples_result = rolled_out(best_.controls, optimizer_.sigma, optimizer_.rollouts);
      if (!samples_result) return samples_result.error();
      // Lines 11 to 13; the first of equals.
      for (Candidate& sample : *samples_result) {
        if (sample.is_better_than(best_)) best_ = std::move(sample);
      }
    }
    if (best_.cost == kInfinity) {
      return Error{Code::kInvalidArgument,
                   fmt::format("x0: all {} rollouts from it diverged ({}), wanted a state that physics can start from",
                               plan_.rollouts, divergence_)};
    }
    return finished();
  }

 private:
  Result<void> draw_worlds() {
    for (int j = 0; j <= options_.worlds; ++j) {
      const Scene scene = j == 0 ? scene_ : physics_pool::realize(scene_, options_.bounds, problem_.seed, j);
      World world{.hash = problem_.world};
      if (j > 0) {
        auto hash_result = pool_.load(scene);
        if (!hash_result) return hash_result.error();
        world.hash = *hash_result;
      }
      for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        world.lifts.push_back(scene.objects[i].rest_height() - scene_.objects[i].rest_height());
      }
      for (int i = 0; i < options_.starts; ++i) {
        world.starts.push_back(
            physics_pool::nearby_start(scene_, scene, problem_.x0, options_.spread, problem_.seed, i));
      }
      worlds_.push_back(std::move(world));
    }
    return {};
  }

  RolloutBatch batch_of(const ControlSequence& nominal, const std::vector<double>& sigma, int samples) const {
    RolloutBatch batch{.world = problem_.world, .x0 = problem_.x0, .nominal = nominal};
    batch.u_before = problem_.u_before;
    if (batch.u_before.empty()) batch.u_before.assign(static_cast<std::size_t>(nominal.nu), 0.0);
    batch.step_duration = optimizer_.step_duration;
    batch.law = {
        .sigma = sigma,
        .limit = optimizer_.limit,
        .scales = optimizer_.scales,
        .seed = problem_.seed,
        .stream = (problem_.stream + static_cast<std::uint32_t>(plan_.iterations)) % physics_pool::kSamplingStreams,
        .persistence = optimizer_.persistence};
    batch.samples = static_cast<std::uint32_t>(samples);
    batch.objective = problem_.objective;
    batch.stop_losers = false;  // metrics and J_R need every trajectory to its end
    batch.want_all_trajectories = true;
    batch.fidelity = {.freeze = optimizer_.freeze};
    batch.priority = problem_.priority;
    return batch;
  }

  // Lines 7 to 10 for all samples at once: first J's rollouts, then those of every world from every start.
  Result<std::vector<Candidate>> rolled_out(const ControlSequence& nominal, const std::vector<double>& sigma,
                                            int samples) {
    if (std::chrono::steady_clock::now() >= deadline_) return Error{Code::kDeadline, "plan: out of time"};
    std::vector<RolloutBatch> batches{batch_of(nominal, sigma, samples)};
    for (const World& world : worlds_) {
      for (const State& start : world.starts) {
        RolloutBatch batch = batch_of(nominal, sigma, samples);
        batch.world = world.hash;
        batch.x0 = start;
        batch.objective = {};  // nobody asks for its cost
        batches.push_back(std::move(batch));
      }
    }
    const auto asked = batches.size() * static_cast<std::size_t>(samples);
    plan_.rollouts += asked;
    if (problem_.rollouts_asked_for) *problem_.rollouts_asked_for += asked;
    auto replies_result = pool_.run_all(batches, deadline_, stop_);
    if (!replies_result) return replies_result.error();
    std::vector<Candidate> candidates;
    for (std::size_t s = 0; s < static_cast<std::size_t>(samples); ++s) {
      candidates.push_back(candidate_of(batches.front(), *replies_result, s));
    }
    return candidates;
  }

  Candidate candidate_of(const RolloutBatch& batch, const std::vector<BatchReply>& replies, std::size_t s) {
    const RolloutOutcome& planned = replies.front().outcomes[s];
    Candidate candidate;
    candidate.controls = physics_pool::sample_controls(batch.nominal, batch.law, planned.sample);
    if (planned.end == End::kDiverged) {
      divergence_ = planned.reason;
      return candidate;
    }
    candidate.states = planned.trajectory;
    candidate.cost = planned.cost;
    candidate.robust_cost = options_.cost_weight * planned.cost;
    const bool is_cheap = candidate.cost <= problem_.objective.success_cost;
    candidate.at_goal = planned.at_goal && is_cheap;
    candidate.is_feasible = is_cheap && scorer_.final(geometry_, candidate.states.back()) <= options_.terminal_cost;
    if (!is_weighing_) return candidate;
    const std::vector<int> objects = judged(candidate.states);
    std::size_t next = 1;
    for (const World& world : worlds_) {
      std::vector<Trajectory> samples;
      for (std::size_t i = 0; i < world.starts.size(); ++i) {
        samples.push_back(as_in_the_planning_world(replies[next++].outcomes[s], world));
      }
      candidate.worlds.push_back(deviations(geometry_, candidate.states, samples, objects));
    }
    const int n = candidate.controls.steps();
    candidate.expected = path_metric(Metric::kExpected, candidate.worlds, 0, n);
    candidate.robust_cost += options_.expected_weight * candidate.expected +
                             options_.maximal_weight * path_metric(Metric::kMaximal, candidate.worlds, 0, n);
    return candidate;
  }

  // Objects that are taller stand higher: that is no deviation.
  Trajectory as_in_the_planning_world(const RolloutOutcome& outcome, const World& world) const {
    if (outcome.end == End::kDiverged) return {};
    Trajectory states = outcome.trajectory;
    for (State& x : states) {
      for (std::size_t i = 0; i < world.lifts.size(); ++i) {
        x.q[static_cast<std::size_t>(geometry_.layout.objects[i].q) + 2] -= world.lifts[i];
      }
    }
    return states;
  }

  std::vector<int> judged(const Trajectory& planned) const {
    using Judged = RobustStoOptions::Judged;
    std::vector<int> objects;
    const StateView before = geometry_.view(planned.front());
    for (std::size_t i = 0; i < before.objects(); ++i) {
      const auto is_moved = [&](const State& x) {
        const double* from = before.object(i).position();
        const double* to = geometry_.view(x).object(i).position();
        return std::hypot(to[0] - from[0], to[1] - from[1], to[2] - from[2]) >= kMoved;
      };
      if (before.is_target(i) || options_.judged == Judged::kAll ||
          (options_.judged == Judged::kMoved && std::ranges::any_of(planned, is_moved))) {
        objects.push_back(static_cast<int>(i));
      }
    }
    return objects;
  }

  // Line 4.
  bool is_done() const { return best_.is_feasible && (!is_weighing_ || best_.expected <= 1 + options_.tolerance); }

  Plan finished() {
    if (is_weighing_) plan_.robustness = robustness();
    plan_.cost = best_.robust_cost;
    plan_.at_goal = best_.at_goal;
    plan_.controls = std::move(best_.controls);
    plan_.states = std::move(best_.states);
    return std::move(plan_);
  }

  Robustness robustness() const {
    const std::span<const Deviations> all = best_.worlds;
    const auto nominal = all.first(1), realized = all.size() > 1 ? all.subspan(1) : nominal;
    const int n = best_.controls.steps();
    Robustness found{.expected = estimate(Metric::kExpected, all, 0, n),
                     .maximal = estimate(Metric::kMaximal, all, 0, n),
                     .nominal_expected = estimate(Metric::kExpected, nominal, 0, n),
                     .nominal_maximal = estimate(Metric::kMaximal, nominal, 0, n),
                     .realized_expected = estimate(Metric::kExpected, realized, 0, n),
                     .realized_maximal = estimate(Metric::kMaximal, realized, 0, n),
                     .steps = {},
                     .segments = {}};
    for (const Deviations& world : all) found.steps.push_back(step_metrics(Metric::kExpected, world));
    found.segments = find_segments(found.steps, 1 + options_.tolerance, options_.graph);
    return found;
  }

  void report() const {
    if (!on_progress_) return;
    on_progress_({.iteration = plan_.iterations,
                  .cost = best_.robust_cost,
                  .at_goal = best_.at_goal,
                  .rollouts = plan_.rollouts,
                  .final_state = best_.states.empty() ? nullptr : &best_.states.back()});
  }

  physics_pool::Pool& pool_;
  const Scene& scene_;
  const physics_pool::TaskGeometry& geometry_;
  const PbstoOptions& optimizer_;
  const RobustStoOptions& options_;
  const OnProgress& on_progress_;
  const Problem& problem_;
  const TimePoint deadline_;
  const std::stop_token stop_;
  const physics_pool::Scorer scorer_;
  const bool is_weighing_;
  std::vector<World> worlds_;  // [N_w + 1], the planning world first
  Candidate best_;
  Plan plan_;
  std::string divergence_;  // reason of the newest rollout from x0 that diverged
};

}  // namespace

RobustSto::RobustSto(physics_pool::Pool& pool, const Scene& scene, const physics_pool::TaskGeometry& geometry,
                     PbstoOptions optimizer, RobustStoOptions options, OnProgress on_progress)
    : pool_(pool),
      scene_(scene),
      geometry_(geometry),
      optimizer_(std::move(optimizer)),
      options_(options),
      on_progress_(std::move(on_progress)) {}

Result<Plan> RobustSto::plan(const Problem& problem, TimePoint deadline, std::stop_token stop) {
  return Optimization(pool_, scene_, geometry_, optimizer_, options_, on_progress_, problem, deadline, std::move(stop))
      .make();
}

}  // namespace jostle::planners
