#include "services/studies/bench/coarse_grasp.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <numeric>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "planners/control/controller.hpp"
#include "planners/guided/candidates.hpp"
#include "planners/guided/forecast.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/files.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/bench/catalogue.hpp"
#include "services/studies/bench/cheap_physics.hpp"
#include "services/task/config/parameters.hpp"

namespace jostle::studies {
namespace {

using common::number_or_null;
using physics_pool::RolloutBatch;
using physics_pool::Scene;
using planners::Forecast;
using std::chrono::steady_clock;

constexpr std::size_t kBest = 5;  // that guided planning might have the engine judge

// What one kind of physics says of one candidate.
struct Said {
  Forecast forecast;  // of the engine: what came of it
  double seconds = 0.0;
};

// Of one kind of physics against full physics.
struct Ranking {
  std::vector<double> correlations;      // per world
  int right = 0, wrong = 0, missed = 0;  // candidates: successes of both, of this one alone, of full physics alone
  int worlds = 0, found = 0;             // with a success; of which the best five hold one
  std::vector<double> price_of_full, seconds;  // per candidate
};

struct Row {
  int objects = 0;
  Ranking coarse, frozen;
  std::vector<double> full_seconds;
};

double since(steady_clock::time_point start) {
  return std::chrono::duration<double>(steady_clock::now() - start).count();
}

// The candidates of one world, and who is asked about them.
class World {
 public:
  static Result<World> make(const Scene& scene, const task::Parameters& parameters, std::uint64_t seed) {
    auto model_result = physics_pool::QuasiStaticClutter::make(scene);
    if (!model_result) return model_result.error();
    World world(scene, parameters, seed, planners::Forecaster(std::move(model_result).value()));
    auto hash_result = world.pool_->load(scene);
    if (!hash_result) return hash_result.error();
    world.hash_ = *hash_result;
    return world;
  }

  ControlSequence candidate(int index) const {
    return planners::draw_candidate(*geometry_, law_, line_, {.x = &x0_},
                                    {.stream = 0, .number = static_cast<std::uint32_t>(index)});
  }

  Said coarse(const ControlSequence& controls) {
    const physics_pool::Scorer scorer(objective_);
    const std::vector<double> at_rest(static_cast<std::size_t>(line_.nu), 0.0);
    const auto start = steady_clock::now();
    const Forecast forecast = forecaster_.run({.geometry = *geometry_,
                                               .objective = objective_,
                                               .step_duration = law_.step_duration,
                                               .min_steps = law_.min_steps},
                                              scorer, x0_, at_rest, controls);
    return {.forecast = forecast, .seconds = since(start)};
  }

  Result<Said> engine(const ControlSequence& controls, bool freeze, std::stop_token stop) {
    const std::vector<double> none(static_cast<std::size_t>(line_.nu), 0.0);
    RolloutBatch batch{.world = hash_, .x0 = x0_, .nominal = controls, .u_before = none};
    batch.step_duration = law_.step_duration;
    batch.law = {.sigma = none, .limit = law_.limit};
    batch.objective = objective_;
    batch.stop_on_success = true;
    batch.min_steps = law_.min_steps;
    batch.want_all_trajectories = true;
    batch.fidelity = {.freeze = freeze};
    const auto start = steady_clock::now();
    auto reply_result = pool_->run(batch, physics_pool::TimePoint::max(), std::move(stop));
    const double seconds = since(start);
    if (!reply_result) return reply_result.error();
    const physics_pool::RolloutOutcome& outcome = reply_result->outcomes.front();
    Said said{.forecast = {}, .seconds = seconds};
    if (outcome.trajectory.empty()) return said;  // diverged: no cost, no success
    said.forecast = {.cost = outcome.cost,
                     .succeeds = outcome.at_goal && outcome.cost <= objective_.success_cost,
                     .lodged = count_obstructions(*geometry_, outcome.trajectory.back()),
                     .steps = static_cast<int>(outcome.steps)};
    return said;
  }

 private:
  World(const Scene& scene, const task::Parameters& parameters, std::uint64_t seed, planners::Forecaster forecaster)
      : geometry_(std::make_unique<physics_pool::TaskGeometry>(scene)),
        x0_(initial_state(scene)),
        law_{.sigma = parameters.planner.sigma,
             .limit = parameters.planner.limit,
             .step_duration = parameters.planner.step_duration,
             .min_steps = parameters.planner.min_steps,
             .seed = seed},
        line_(
            planners::straight_line(*geometry_, x0_, parameters.controller.control.initial_steps, law_.step_duration)),
        objective_(parameters.objective),
        forecaster_(std::move(forecaster)),
        pool_(std::make_unique<physics_pool::ThreadPool>(1)) {
    objective_["obstruction"].weight = 0.0;  // as in first plans
  }

  std::unique_ptr<physics_pool::TaskGeometry> geometry_;
  State x0_;
  planners::CandidateLaw law_;
  ControlSequence line_;
  physics_pool::Objective objective_;
  planners::Forecaster forecaster_;
  std::unique_ptr<physics_pool::ThreadPool> pool_;
  Hash hash_;
};

void compare(const std::vector<Said>& said, const std::vector<Said>& full, Ranking& ranking) {
  std::vector<double> costs, true_costs;
  for (std::size_t i = 0; i < full.size(); ++i) {
    const bool says = said[i].forecast.succeeds, is = full[i].forecast.succeeds;
    ranking.right += says && is ? 1 : 0;
    ranking.wrong += says && !is ? 1 : 0;
    ranking.missed += !says && is ? 1 : 0;
    ranking.seconds.push_back(said[i].seconds);
    ranking.price_of_full.push_back(full[i].seconds / said[i].seconds);
    costs.push_back(said[i].forecast.cost);
    true_costs.push_back(full[i].forecast.cost);
  }
  ranking.correlations.push_back(rank_correlation(costs, true_costs));
  if (std::ranges::none_of(full, [](const Said& s) { return s.forecast.succeeds; })) return;
  ++ranking.worlds;
  std::vector<std::size_t> order(said.size());
  std::iota(order.begin(), order.end(), 0);
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return said[i].forecast.rank(); });
  order.resize(std::min(order.size(), kBest));
  ranking.found += std::ranges::any_of(order, [&](std::size_t i) { return full[i].forecast.succeeds; }) ? 1 : 0;
}

Result<void> measure(const CoarseGraspOptions& options, const task::Parameters& parameters, Row& row) {
  for (int w = 0; w < options.worlds; ++w) {
    const std::uint64_t seed = options.seed + static_cast<std::uint64_t>(w);
    auto scene_result = physics_pool::generate_chapter3({.objects = row.objects, .seed = seed});
    if (!scene_result) return scene_result.error();
    auto world_result = World::make(*scene_result, parameters, seed);
    if (!world_result) return world_result.error();
    std::vector<Said> coarse, frozen, full;
    for (int i = 0; i < options.candidates; ++i) {
      const ControlSequence controls = world_result->candidate(i);
      coarse.push_back(world_result->coarse(controls));
      for (const bool freeze : {true, false}) {
        auto said_result = world_result->engine(controls, freeze, options.stop);
        if (!said_result) return said_result.error();
        (freeze ? frozen : full).push_back(std::move(said_result).value());
      }
    }
    compare(coarse, full, row.coarse);
    compare(frozen, full, row.frozen);
    for (const Said& said : full) row.full_seconds.push_back(said.seconds);
    options.line->step(fmt::format("{} objects, world {}", row.objects, seed));
  }
  return {};
}

nlohmann::json summary(const std::vector<double>& values) {
  return {{"median", number_or_null(common::median(values))},
          {"p10", number_or_null(common::quantile(values, 0.1))},
          {"p90", number_or_null(common::quantile(values, 0.9))}};
}

nlohmann::json to_json(const Ranking& ranking) {
  return {{"seconds", summary(ranking.seconds)},
          {"times_cheaper_than_full", summary(ranking.price_of_full)},
          {"rank_correlation", summary(ranking.correlations)},
          {"successes_right", ranking.right},
          {"successes_wrong", ranking.wrong},
          {"successes_missed", ranking.missed},
          {"worlds_with_a_success", ranking.worlds},
          {"best_five_hold_one", ranking.found}};
}

void print(const char* name, const Ranking& r) {
  fmt::print(
      "  {:<7} {:>9.3f} ms  {:>6.0f} times cheaper than full; rank correlation {:.2f} ({:.2f} to {:.2f}); "
      "success right/wrong/missed {}/{}/{}; best five hold one in {} of {} worlds\n",
      name, 1e3 * common::median(r.seconds), common::median(r.price_of_full), common::median(r.correlations),
      common::quantile(r.correlations, 0.1), common::quantile(r.correlations, 0.9), r.right, r.wrong, r.missed, r.found,
      r.worlds);
}

}  // namespace

Result<void> bench_coarse_grasp(const CoarseGraspOptions& options) {
  auto parameters_result = task::load_parameters(options.parameters);
  if (!parameters_result) return parameters_result.error();
  options.line->expect(options.objects.size() * static_cast<std::size_t>(options.worlds));
  std::vector<Row> rows;
  Result<void> ok;
  for (const int objects : options.objects) {
    Row& row = rows.emplace_back();
    row.objects = objects;
    ok = measure(options, *parameters_result, row);
    if (!ok) break;
  }
  options.line->end();
  if (!ok && ok.error().code != Code::kCancelled) return ok;
  nlohmann::json results{{"worlds", options.worlds}, {"candidates", options.candidates}, {"seed", options.seed}};
  for (const Row& row : rows) {
    fmt::print("{} objects, {} worlds, {} candidates each; full physics {:.0f} ms\n", row.objects,
               row.coarse.correlations.size(), options.candidates, 1e3 * common::median(row.full_seconds));
    print("coarse", row.coarse);
    print("frozen", row.frozen);
    results["rows"].push_back({{"objects", row.objects},
                               {"full_seconds", summary(row.full_seconds)},
                               {"coarse", to_json(row.coarse)},
                               {"frozen", to_json(row.frozen)}});
  }
  if (!ok) results["partial"] = true;
  if (!options.json.empty()) {
    if (auto written = common::write_results(options.json, std::move(results)); !written) return written;
  }
  return ok;
}

namespace {

class CoarseGrasp final : public Benchmark {
 public:
  CoarseGrasp()
      : Benchmark("coarse-grasp", "coarse physics of a grasp beside the engine: price, ranking, successes found",
                  "15 min", Uses::kNothing) {}

  void add_options(CLI::App& app) override {
    app.add_option("--objects", options_.objects, "Objects beside the target, one row of the table each")
        ->delimiter(',')
        ->capture_default_str()
        ->check(CLI::Range(0, 40));
    app.add_option("--worlds", options_.worlds, "Worlds for each")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    app.add_option("--candidates", options_.candidates, "Candidates in each world")
        ->capture_default_str()
        ->check(CLI::Range(2, 100'000));
    common::add_seed_option(app, "--seed", options_.seed, "Seed of the first world; the next ones follow");
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.parameters = common::data_file("experiments/grasping.yaml");
    options_.json = json;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_coarse_grasp(options_));
  }

  const char* unit() const override { return "worlds"; }

 private:
  CoarseGraspOptions options_;
};

}  // namespace

std::unique_ptr<Benchmark> coarse_grasp_benchmark() { return std::make_unique<CoarseGrasp>(); }

}  // namespace jostle::studies
