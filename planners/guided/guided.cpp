#include "planners/guided/guided.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <numeric>
#include <thread>

#include "physics_pool/sampling/counter_rng.hpp"
#include "planners/guided/candidates.hpp"
#include "planners/search/search.hpp"

namespace jostle::planners {
namespace {

using physics_pool::BatchReply;
using physics_pool::RolloutBatch;

constexpr std::size_t kElites = 6;        // that later generations are drawn around
constexpr int kMostGenerations = 2;       // times as many as asked for, while none succeeds
constexpr std::size_t kMostJudged = 8;    // per iteration
constexpr double kDifferent = 0.012;      // m: candidates whose hands are never farther apart are the same
constexpr double kAroundElites = 0.6;     // share of a later generation
constexpr double kFromKnownStates = 0.3;  // share of the other draws, once the engine has been somewhere
constexpr double kFullestElite = 0.5;     // of sigma, the largest noise around an elite in the second generation
constexpr std::size_t kDoubted = 24;      // of the best, are forecast again under other assumptions
constexpr std::size_t kAtATime = 8;       // candidates that a thread takes

// What the engine made of a candidate.
struct Judged {
  ControlSequence controls;
  Trajectory states;               // as far as it got
  std::vector<double> step_costs;  // of them
};

// Of friction between bodies and on the surface. The best of hundreds is the best because of what the model gets wrong,
// unless it is good under each of these as well.
constexpr std::array<std::pair<double, double>, 4> kDoubts{{{0.3, 1.0}, {0.8, 1.0}, {0.5, 0.7}, {0.5, 1.4}}};

struct Candidate {
  ControlSequence controls;
  Forecast forecast;
  // Where it leaves a state that the engine has been in; else the plan's own.
  const Judged* known = nullptr;
  int first = 0;
  double doubted_rank = 0.0;  // mean over the assumptions
};

// One call of plan().
class Guided {
 public:
  Guided(const physics_pool::TaskGeometry& geometry, const PbstoOptions& options, const GuidanceOptions& guidance,
         std::vector<Forecaster>& forecasters, const Problem& problem, TimePoint deadline, std::stop_token stop,
         Search& search)
      : geometry_(geometry),
        guidance_(guidance),
        forecasters_(forecasters),
        problem_(problem),
        deadline_(deadline),
        stop_(std::move(stop)),
        search_(search),
        scorer_(problem.objective),
        law_{.sigma = options.sigma,
             .limit = options.limit,
             .step_duration = options.step_duration,
             .min_steps = options.min_steps,
             .seed = problem.seed},
        scored_by_{.geometry = geometry,
                   .objective = problem.objective,
                   .step_duration = options.step_duration,
                   .min_steps = options.min_steps},
        u_before_(problem.u_before) {
    if (u_before_.empty()) u_before_.assign(static_cast<std::size_t>(problem.initial.nu), 0.0);
  }

  // One iteration. An initial sequence that coarse physics believes in, as what is left of a good plan, is judged
  // before anything is drawn: where the engine agrees it is the plan, as in Alg. 1 and 2.
  Result<void> improve() {
    const auto iteration = static_cast<std::uint32_t>(search_.best().iterations);
    if (iteration == 0 && forecast({.controls = problem_.initial}, forecasters_[0]).succeeds) {
      if (auto ok = judge({problem_.initial}); !ok || search_.best().at_goal) return ok;
    }
    stream_ = (problem_.stream + iteration) % physics_pool::kSamplingStreams;
    candidates_.clear();
    // Coarse physics is cheap: while nothing is promised, it goes on before the engine is asked.
    const int generations = std::max(guidance_.generations, 1), most = kMostGenerations * generations;
    for (int g = 0; g < most && (g < generations || !promises()); ++g) {
      const int size = guidance_.candidates * (g % generations + 1) / generations -
                       guidance_.candidates * (g % generations) / generations;
      if (auto ok = run_generation(g, size); !ok) return ok;
    }
    auto best_result =
        best_in_doubt(std::min(static_cast<std::size_t>(guidance_.judged) << std::min(denials_, 3u), kMostJudged));
    if (!best_result) return best_result.error();
    std::vector<ControlSequence> chosen;
    for (const std::size_t i : *best_result) chosen.push_back(candidates_[i].controls);
    // A plan is never worse than what it began with. Last, for coarse physics has found better ones, it says.
    if (judged_.empty() && std::ranges::find(chosen, problem_.initial) == chosen.end()) {
      chosen.push_back(problem_.initial);
    }
    const bool promised = promises();
    if (auto ok = judge(chosen); !ok) return ok;
    if (promised && !search_.best().at_goal) ++denials_;
    return {};
  }

 private:
  bool promises() const {
    return std::ranges::any_of(candidates_, [](const Candidate& c) { return c.forecast.succeeds; });
  }

  // Draws and forecasts so many candidates.
  Result<void> run_generation(int generation, int size) {
    const std::vector<std::size_t> elites = generation > 0 ? best_that_differ(kElites) : std::vector<std::size_t>{};
    const std::size_t offset = candidates_.size();
    candidates_.resize(offset + static_cast<std::size_t>(size));
    return in_parallel(offset, candidates_.size(), [&](std::size_t i, Forecaster& forecaster) {
      make(generation, i, elites, candidates_[i]);
      candidates_[i].forecast = forecast(candidates_[i], forecaster);
    });
  }

  // Forecasts the best ones again under other assumptions, and returns the best of them.
  Result<std::vector<std::size_t>> best_in_doubt(std::size_t most) {
    std::vector<std::size_t> best = best_that_differ(std::max(kDoubted, most));
    std::vector<double> ranks(best.size() * kDoubts.size());
    const auto ok = in_parallel(0, ranks.size(), [&](std::size_t i, Forecaster& forecaster) {
      const auto& [contact, support] = kDoubts[i % kDoubts.size()];
      forecaster.assume({.contact_friction = contact, .support_friction = support});
      ranks[i] = forecast(candidates_[best[i / kDoubts.size()]], forecaster).rank();
      forecaster.assume({});
    });
    if (!ok) return ok.error();
    for (std::size_t n = 0; n < best.size(); ++n) {
      Candidate& candidate = candidates_[best[n]];
      double sum = candidate.forecast.rank();
      for (std::size_t d = 0; d < kDoubts.size(); ++d) sum += ranks[n * kDoubts.size() + d];
      candidate.doubted_rank = sum / (kDoubts.size() + 1.0);
    }
    std::ranges::stable_sort(best, {}, [&](std::size_t i) { return candidates_[i].doubted_rank; });
    best.resize(std::min(best.size(), most));
    return best;
  }

  Forecast forecast(const Candidate& candidate, Forecaster& forecaster) const {
    if (!candidate.known || candidate.first == 0) {
      return forecaster.run(scored_by_, scorer_, problem_.x0, u_before_, candidate.controls);
    }
    const Judged& known = *candidate.known;
    const double so_far = std::accumulate(known.step_costs.begin(), known.step_costs.begin() + candidate.first, 0.0);
    return forecaster.run(scored_by_, scorer_, known.states[static_cast<std::size_t>(candidate.first)],
                          known.controls.step(candidate.first - 1), candidate.controls, candidate.first, so_far);
  }

  // Calls work(i, forecaster) for first <= i < end, in any order and from several threads.
  template <class Work>
  Result<void> in_parallel(std::size_t first, std::size_t end, const Work& work) {
    std::atomic<std::size_t> next = first;
    const auto take = [&](Forecaster& forecaster) {
      for (;;) {
        const std::size_t from = next.fetch_add(kAtATime);
        if (from >= end || is_over()) return;
        for (std::size_t i = from; i < std::min(from + kAtATime, end); ++i) work(i, forecaster);
      }
    };
    {
      std::vector<std::jthread> helpers;
      for (std::size_t t = 1; t < forecasters_.size(); ++t) {
        helpers.emplace_back([&, t] { take(forecasters_[t]); });
      }
      take(forecasters_[0]);
    }
    if (stop_.stop_requested()) return Error{Code::kCancelled, "plan: cancelled"};
    if (is_over()) return Error{Code::kDeadline, "plan: out of time"};
    return {};
  }

  bool is_over() const { return stop_.stop_requested() || std::chrono::steady_clock::now() >= deadline_; }

  // A pure function of the indices, of the elites and of what the engine has judged.
  void make(int generation, std::size_t i, const std::vector<std::size_t>& elites, Candidate& candidate) const {
    const CandidateIndex index{.stream = stream_, .number = static_cast<std::uint32_t>(i)};
    if (i == 0) {
      candidate.controls = problem_.initial;
    } else if (i == 1) {
      candidate.controls = search_.best().controls;
    } else if (const double way = choice(index, 0); !elites.empty() && way < kAroundElites) {
      const std::size_t elite = elites[i % elites.size()];
      const int age = (generation - 1) % std::max(guidance_.generations, 1);
      const double scale = kFullestElite * std::pow(0.5, age + 3 * choice(index, 1));
      candidate.controls = draw_around(law_, candidates_[elite].controls, scale, index);
    } else if (!judged_.empty() && choice(index, 2) < kFromKnownStates) {
      const Judged& known = judged_[static_cast<std::size_t>(choice(index, 3) * static_cast<double>(judged_.size()))];
      const int last = std::min(static_cast<int>(known.states.size()) - 1, problem_.initial.steps() - 1);
      const int first = last > 0 ? 1 + static_cast<int>(choice(index, 4) * last) : 0;
      candidate.controls = draw_candidate(
          geometry_, law_, problem_.initial,
          {.x = &known.states[static_cast<std::size_t>(first)], .so_far = &known.controls, .steps = first}, index);
      candidate.known = &known;
      candidate.first = first;
    } else {
      candidate.controls = draw_candidate(geometry_, law_, problem_.initial, {.x = &problem_.x0}, index);
    }
  }

  // A number in (0, 1) to choose by, independent of those that draw_candidate uses.
  double choice(const CandidateIndex& index, std::uint32_t which) const {
    return physics_pool::standard_uniform(
        law_.seed, {.stream = index.stream, .sample = index.number, .step = which, .axis = 1u << 17});
  }

  // Indices of the candidates of lowest rank, each of which differs from those before it and from all that the engine
  // has judged; ties by index.
  std::vector<std::size_t> best_that_differ(std::size_t most) const {
    std::vector<std::size_t> order(candidates_.size());
    std::iota(order.begin(), order.end(), 0);
    std::ranges::sort(order, {}, [&](std::size_t i) { return std::pair(candidates_[i].forecast.rank(), i); });
    std::vector<std::size_t> chosen;
    const auto differs = [&](const ControlSequence& controls, const ControlSequence& other) {
      return distance_between(geometry_, controls, other, law_.step_duration) > kDifferent;
    };
    for (const std::size_t i : order) {
      if (chosen.size() >= most || !std::isfinite(candidates_[i].forecast.rank())) break;
      const ControlSequence& controls = candidates_[i].controls;
      if (std::ranges::all_of(chosen, [&](std::size_t j) { return differs(controls, candidates_[j].controls); }) &&
          std::ranges::all_of(judged_, [&](const Judged& j) { return differs(controls, j.controls); })) {
        chosen.push_back(i);
      }
    }
    return chosen;
  }

  // Has the engine roll sequences out as they are, side by side, and keeps the first that is enough, or else the
  // cheapest.
  Result<void> judge(const std::vector<ControlSequence>& chosen) {
    std::vector<RolloutBatch> batches;
    for (const ControlSequence& controls : chosen) {
      RolloutBatch one = search_.around(controls);
      std::ranges::fill(one.law.sigma, 0.0);
      one.want_all_trajectories = true;
      batches.push_back(std::move(one));
    }
    if (batches.empty()) return {};  // nothing new
    auto replies_result = search_.run_in_order(batches);
    if (!replies_result) return replies_result.error();
    for (std::size_t i = 0; i < batches.size(); ++i) {
      const BatchReply& reply = (*replies_result)[i];
      if (reply.outcomes.empty()) break;  // behind one that is enough
      const physics_pool::RolloutOutcome& outcome = reply.outcomes.front();
      const bool enough = search_.is_enough(reply);
      if (enough || (winner_of(reply) && outcome.cost < search_.best().cost)) search_.adopt(batches[i], reply);
      if (enough) break;
      judged_.push_back({.controls = batches[i].nominal,
                         .states = outcome.trajectory.empty() ? Trajectory{problem_.x0} : outcome.trajectory,
                         .step_costs = outcome.step_costs});
    }
    return {};
  }

  const physics_pool::TaskGeometry& geometry_;
  const GuidanceOptions& guidance_;
  std::vector<Forecaster>& forecasters_;
  const Problem& problem_;
  const TimePoint deadline_;
  const std::stop_token stop_;
  Search& search_;
  const physics_pool::Scorer scorer_;
  const CandidateLaw law_;
  const ForecastProblem scored_by_;
  std::vector<double> u_before_;
  std::uint32_t stream_ = 0;
  std::vector<Candidate> candidates_;  // of this iteration
  unsigned denials_ = 0;               // iterations in which the engine denied what coarse physics promised
  std::vector<Judged> judged_;         // in this plan, without success
};

}  // namespace

Result<std::unique_ptr<GuidedPlanner>> GuidedPlanner::make(physics_pool::Pool& pool, const physics_pool::Scene& scene,
                                                           const PbstoOptions& options, const GuidanceOptions& guidance,
                                                           OnProgress on_progress) {
  const auto planar = as_planar(scene.robot.model);
  if (!planar || planar->rotation < 0 || !scene.robot.model.hand) {
    return invalid("planner.guidance",
                   fmt::format("{} candidates for the robot '{}'", guidance.candidates, scene.robot.model.name),
                   "0 for robots other than a hand that moves in the plane and turns");
  }
  auto model_result = physics_pool::QuasiStaticClutter::make(scene);
  if (!model_result) return model_result.error();
  std::unique_ptr<GuidedPlanner> planner(new GuidedPlanner(pool, scene, options, guidance, std::move(on_progress)));
  const unsigned threads = guidance.threads > 0 ? static_cast<unsigned>(guidance.threads)
                                                : std::max(std::thread::hardware_concurrency(), 1u);
  planner->forecasters_.assign(threads, Forecaster(std::move(model_result).value()));
  return planner;
}

GuidedPlanner::GuidedPlanner(physics_pool::Pool& pool, const physics_pool::Scene& scene, const PbstoOptions& options,
                             const GuidanceOptions& guidance, OnProgress on_progress)
    : pool_(pool), geometry_(scene), options_(options), guidance_(guidance), on_progress_(std::move(on_progress)) {}

Result<Plan> GuidedPlanner::plan(const Problem& problem, TimePoint deadline, std::stop_token stop) {
  const RolloutBatch pattern{.step_duration = options_.step_duration,
                             .law = {.sigma = options_.sigma, .limit = options_.limit},
                             .stop_losers = options_.stop_losers,
                             .stop_hopeless = options_.stop_hopeless,
                             .min_steps = options_.min_steps};
  Search search(pool_, problem, pattern, deadline, stop, on_progress_);
  Guided guided(geometry_, options_, guidance_, forecasters_, problem, deadline, std::move(stop), search);
  if (problem.iterations < 1) return search.until_done([] { return Result<void>{}; });
  return search.improve_until_done([&] { return guided.improve(); });
}

}  // namespace jostle::planners
