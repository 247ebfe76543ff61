#include "services/studies/bench/convergence.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "physics_pool/objective/terms.hpp"
#include "planners/control/controller.hpp"
#include "planners/pbsto/pbsto.hpp"
#include "planners/sampling/sampling.hpp"
#include "services/common/charts/plot.hpp"
#include "services/common/charts/statistics.hpp"

namespace jostle::studies {

using physics_pool::BatchReply;
using physics_pool::Pool;
using physics_pool::RolloutBatch;
using physics_pool::Scene;
using planners::PbstoOptions;
using planners::SamplingOptions;

namespace {

// The same physics for everybody, but for planners that screen with another.
class AtFidelity final : public Pool {
 public:
  AtFidelity(Pool& pool, const physics_pool::Fidelity& fidelity) : pool_(pool), fidelity_(fidelity) {}

  Result<Hash> load(const Scene& scene) override { return pool_.load(scene); }
  Result<BatchReply> run(const RolloutBatch& batch, physics_pool::TimePoint deadline, std::stop_token stop) override {
    RolloutBatch same = batch;
    if (same.fidelity == physics_pool::Fidelity{}) same.fidelity = fidelity_;
    return pool_.run(same, deadline, stop);
  }
  physics_pool::PoolStatus status() const override { return pool_.status(); }

 private:
  Pool& pool_;
  physics_pool::Fidelity fidelity_;
};

Contender pbsto(std::string name, PbstoOptions::Update update) {
  return {std::move(name), [update](Pool& pool, const ConvergenceOptions& options, planners::OnProgress on_progress) {
            PbstoOptions own;
            own.update = update;
            own.rollouts = options.batch;
            own.step_duration = options.step_duration;
            return std::make_unique<planners::Pbsto>(pool, std::move(own), std::move(on_progress));
          }};
}

// The one sigma whose noise has the variance of PBSTO's several scales together.
std::vector<double> equal_sigma(const PbstoOptions& pbsto) {
  double squares = 0.0;
  for (const double scale : pbsto.scales) squares += scale * scale;
  const double factor = std::sqrt(squares / static_cast<double>(pbsto.scales.size()));
  std::vector<double> sigma = pbsto.sigma;
  for (double& value : sigma) value *= factor;
  return sigma;
}

Contender sampling(std::string name, SamplingOptions::Method method) {
  return {std::move(name), [method](Pool& pool, const ConvergenceOptions& options, planners::OnProgress on_progress) {
            SamplingOptions own{.method = method,
                                .rollouts = options.batch,
                                .sigma = equal_sigma({}),
                                .step_duration = options.step_duration};
            return std::make_unique<planners::SamplingPlanner>(pool, std::move(own), std::move(on_progress));
          }};
}

// One world, ready to be searched.
struct Arena {
  const Scene& scene;
  planners::Problem problem;  // but for the seed and the objective

  static Result<Arena> make(Pool& pool, const Scene& scene, const ConvergenceOptions& options) {
    auto world_result = pool.load(scene);
    if (!world_result) return world_result.error();
    Arena arena{.scene = scene, .problem = {.world = *world_result, .x0 = physics_pool::initial_state(scene)}};
    arena.problem.initial = planners::straight_line(physics_pool::TaskGeometry(scene), arena.problem.x0, options.steps,
                                                    options.step_duration);
    return arena;
  }
};

// Searches until the budget is spent. A planner knows iterations only, and not
// all of them cost the same: it is stopped from outside.
Result<Curve> search(Pool& pool, const Arena& arena, const Contender& contender, std::uint64_t seed,
                     const ConvergenceOptions& options, std::stop_token stop) {
  Curve curve{.method = contender.name, .world = arena.scene.name, .seed = seed};
  std::stop_source enough;
  const std::stop_callback forward(stop, [&enough] { enough.request_stop(); });
  const auto start = std::chrono::steady_clock::now();
  const auto planner = contender.make(pool, options, [&](const planners::Progress& progress) {
    const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - start;
    curve.points.push_back({progress.rollouts, elapsed.count(), progress.cost});
    if (progress.rollouts >= options.rollouts) enough.request_stop();
  });
  planners::Problem problem = arena.problem;
  problem.seed = seed;
  problem.objective = options.objective;
  problem.objective["obstruction"].weight = 0.0;  // as in a controller's first plan
  problem.iterations =
      static_cast<int>(std::min<std::uint64_t>(options.rollouts, 1'000'000));  // each costs one or more
  auto plan_result = planner->plan(problem, physics_pool::TimePoint::max(), enough.get_token());
  if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
  const bool spent = !curve.points.empty() && curve.points.back().rollouts >= options.rollouts;
  if (!plan_result && !spent) return plan_result.error();
  return curve;
}

double spent_at(const CurvePoint& point, Spent spent) {
  return spent == Spent::kRollouts ? static_cast<double>(point.rollouts) : point.seconds;
}

double relative_cost(const Curve& curve, Spent spent, double x) {
  const auto after = std::ranges::upper_bound(curve.points, x, {},
                                              [spent](const CurvePoint& point) { return spent_at(point, spent); });
  return after == curve.points.begin() ? 1.0 : std::prev(after)->cost / curve.points.front().cost;
}

Summary summarize(const std::vector<const Curve*>& curves, Spent spent, int points) {
  std::vector<double> firsts, lasts;
  for (const Curve* curve : curves) {
    firsts.push_back(spent_at(curve->points.front(), spent));
    lasts.push_back(spent_at(curve->points.back(), spent));
  }
  const double first = std::ranges::min(firsts);
  const double last = spent == Spent::kRollouts ? std::ranges::max(lasts) : common::median(lasts);
  Summary summary{.method = curves.front()->method};
  for (int i = 0; i < points; ++i) {
    const double x = i + 1 == points ? last : first * std::pow(last / first, i / std::max(points - 1.0, 1.0));
    std::vector<double> costs;
    for (const Curve* curve : curves) costs.push_back(relative_cost(*curve, spent, x));
    summary.x.push_back(x);
    summary.low.push_back(common::quantile(costs, 0.25));
    summary.median.push_back(common::median(costs));
    summary.high.push_back(common::quantile(costs, 0.75));
  }
  return summary;
}

common::Panel panel_of(const std::vector<Curve>& curves, Spent spent) {
  common::Panel panel{.x_label = spent == Spent::kRollouts ? "rollouts" : "seconds",
                      .y_label = "cost, straight line = 1",
                      .log_x = true,
                      .log_y = true};
  for (Summary& summary : summarize(curves, spent)) {
    panel.bands.push_back({.name = std::move(summary.method),
                           .x = std::move(summary.x),
                           .low = std::move(summary.low),
                           .middle = std::move(summary.median),
                           .high = std::move(summary.high)});
  }
  return panel;
}

}  // namespace

std::vector<Contender> usual_contenders() {
  return {pbsto("greedy", PbstoOptions::Update::kGreedy),
          pbsto("cost-weighted", PbstoOptions::Update::kCostWeighted),
          sampling("predictive sampling", SamplingOptions::Method::kPredictive),
          sampling("MPPI", SamplingOptions::Method::kMppi),
          sampling("CEM", SamplingOptions::Method::kCem),
          sampling("iCEM-like", SamplingOptions::Method::kIcem)};
}

Result<std::vector<Curve>> measure_convergence(Pool& pool, const std::vector<Scene>& scenes,
                                               const ConvergenceOptions& options, const OnCurve& on_curve,
                                               std::stop_token stop) {
  if (options.contenders.empty() || scenes.empty() || options.seeds.empty() || options.rollouts < 1 ||
      options.steps < 1) {
    return Error{
        Code::kInvalidArgument,
        fmt::format("convergence: got {} contenders, {} scenes, {} seeds, {} rollouts and {} steps, "
                    "wanted at least one of each",
                    options.contenders.size(), scenes.size(), options.seeds.size(), options.rollouts, options.steps)};
  }
  AtFidelity same(pool, options.fidelity);
  ConvergenceOptions endless = options;
  endless.objective.success_cost = 0.0;
  const std::size_t total = scenes.size() * options.seeds.size() * options.contenders.size();
  std::vector<Curve> curves;
  for (const Scene& scene : scenes) {
    auto arena_result = Arena::make(same, scene, options);
    if (!arena_result) return arena_result.error();
    // What the first batch in a world pays for once, nobody should.
    ConvergenceOptions brief = endless;
    brief.rollouts = 2;
    if (auto ok = search(same, *arena_result, options.contenders.front(), 0, brief, stop); !ok) return ok.error();
    for (const std::uint64_t seed : options.seeds) {
      for (const Contender& contender : options.contenders) {
        auto curve_result = search(same, *arena_result, contender, seed, endless, stop);
        if (!curve_result) return curve_result.error();
        curves.push_back(std::move(curve_result).value());
        if (on_curve) on_curve(curves.back(), curves.size(), total);
      }
    }
  }
  return curves;
}

std::vector<Summary> summarize(const std::vector<Curve>& curves, Spent spent, int points) {
  std::vector<std::string> methods;
  for (const Curve& curve : curves) {
    if (std::ranges::find(methods, curve.method) == methods.end()) methods.push_back(curve.method);
  }
  std::vector<Summary> summaries;
  for (const std::string& method : methods) {
    std::vector<const Curve*> own;
    for (const Curve& curve : curves) {
      const bool comparable =
          !curve.points.empty() && curve.points.front().cost > 0 && std::isfinite(curve.points.front().cost);
      if (curve.method == method && comparable) own.push_back(&curve);
    }
    if (!own.empty()) summaries.push_back(summarize(own, spent, points));
  }
  return summaries;
}

nlohmann::json to_json(const std::vector<Curve>& curves) {
  nlohmann::json list = nlohmann::json::array();
  for (const Curve& curve : curves) {
    nlohmann::json object{{"method", curve.method}, {"world", curve.world}, {"seed", curve.seed}};
    for (const char* column : {"rollouts", "seconds", "cost"}) object[column] = nlohmann::json::array();
    for (const CurvePoint& point : curve.points) {
      object["rollouts"].push_back(point.rollouts);
      object["seconds"].push_back(point.seconds);
      object["cost"].push_back(std::isfinite(point.cost) ? nlohmann::json(point.cost) : nlohmann::json());
    }
    list.push_back(std::move(object));
  }
  return {{"curves", std::move(list)}};
}

Result<void> plot_convergence(const std::vector<Curve>& curves, const std::filesystem::path& png) {
  std::set<std::pair<std::string, std::uint64_t>> runs;
  for (const Curve& curve : curves) runs.emplace(curve.world, curve.seed);
  return common::plot(
      png, fmt::format("Cost of the best plan so far: median and quartiles of {} searches each", runs.size()),
      {panel_of(curves, Spent::kRollouts), panel_of(curves, Spent::kSeconds)});
}

}  // namespace jostle::studies
