#include "services/studies/bench/first_plan.hpp"

#include <fmt/format.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/files.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/bench/catalogue.hpp"
#include "services/task/session/composition.hpp"
#include "services/world/in_process/in_process_world.hpp"

namespace jostle::studies {
namespace {

using physics_pool::Scene;
using planners::Plan;
using planners::Planner;
using std::chrono::steady_clock;

std::uint64_t engine_steps_of(const physics_pool::Pool& pool) {
  std::uint64_t sum = 0;
  for (const physics_pool::WorkerStatus& worker : pool.status().workers) sum += worker.engine_steps;
  return sum;
}

// Stands between a controller and its planner, and looks at the clock.
class Stopwatch final : public Planner {
 public:
  Stopwatch(Planner& planner, const physics_pool::Pool& pool, std::vector<TimedPlan>& plans)
      : planner_(planner), pool_(pool), plans_(plans) {}

  Result<Plan> plan(const planners::Problem& problem, TimePoint deadline, std::stop_token stop) override {
    const std::uint64_t steps = engine_steps_of(pool_);
    const auto start = steady_clock::now();
    auto plan_result = planner_.plan(problem, deadline, std::move(stop));
    plans_.push_back({.seconds = std::chrono::duration<double>(steady_clock::now() - start).count(),
                      .engine_steps = engine_steps_of(pool_) - steps});
    return plan_result;
  }

 private:
  Planner& planner_;
  const physics_pool::Pool& pool_;
  std::vector<TimedPlan>& plans_;
};

Result<void> run_in(const Scene& scene, const physics_pool::WorldPtr& truth, std::uint64_t seed,
                    const task::Parameters& parameters, physics_pool::Pool& pool, FirstPlanSide& side,
                    std::stop_token stop) {
  auto run_result = task::Composition::make(
      {.belief = scene, .belief_is_exact = true, .parameters = parameters, .controller = "or", .seed = seed}, pool);
  if (!run_result) return run_result.error();
  physics_pool::ExecutionWorld world(truth);
  world::SimulatedRobot robot(world);
  world::SimulatedObjects objects(world, scene);
  std::vector<TimedPlan> plans;
  auto outcome_result = run_result->perform(
      robot, objects,
      {.on_event = {},
       .on_progress = {},
       .around_planner = [&](Planner& planner) { return std::make_unique<Stopwatch>(planner, pool, plans); }},
      stop);
  if (!outcome_result) return outcome_result.error();
  ++side.worlds;
  side.solved += outcome_result->success ? 1 : 0;
  side.planned += outcome_result->first_plan.at_goal ? 1 : 0;
  if (plans.empty()) return {};
  side.first.push_back(plans.front());
  side.replans.insert(side.replans.end(), plans.begin() + 1, plans.end());
  return {};
}

template <class Get>
std::vector<double> values_of(const std::vector<TimedPlan>& plans, Get get) {
  std::vector<double> values;
  for (const TimedPlan& plan : plans) values.push_back(static_cast<double>(get(plan)));
  return values;
}

std::vector<double> seconds_of(const std::vector<TimedPlan>& plans) {
  return values_of(plans, [](const TimedPlan& plan) { return plan.seconds; });
}

nlohmann::json summary(const std::vector<double>& values) {
  return {{"median", common::number_or_null(common::median(values))},
          {"p90", common::number_or_null(common::quantile(values, 0.9))},
          {"values", values}};
}

nlohmann::json to_json(const FirstPlanSide& side) {
  const auto steps = [](const TimedPlan& plan) { return plan.engine_steps; };
  return {{"name", side.name},
          {"worlds", side.worlds},
          {"solved", side.solved},
          {"planned", side.planned},
          {"plan_seconds", summary(seconds_of(side.first))},
          {"replan_seconds", summary(seconds_of(side.replans))},
          {"plan_engine_steps", summary(values_of(side.first, steps))},
          {"replan_engine_steps", summary(values_of(side.replans, steps))}};
}

}  // namespace

Result<std::vector<FirstPlanSide>> measure_first_plans(const FirstPlanOptions& options,
                                                       const std::filesystem::path& parameters, std::stop_token stop) {
  auto parameters_result = task::load_parameters(parameters);
  if (!parameters_result) return parameters_result.error();
  task::Parameters before = *parameters_result;
  before.limits.timeout = std::chrono::milliseconds(static_cast<long>(1e3 * options.timeout));
  before.guidance.candidates = 0;
  task::Parameters after = before;
  after.guidance.candidates = options.guidance;
  physics_pool::ThreadPool pool(options.workers);
  std::vector<FirstPlanSide> sides;
  if (options.before) sides.push_back({.name = "without guidance"});
  sides.push_back({.name = "with guidance"});
  options.line->expect(sides.size() * static_cast<std::size_t>(options.worlds));
  for (int i = 0; i < options.worlds; ++i) {
    const std::uint64_t seed = options.first_seed + static_cast<std::uint64_t>(i);
    auto scene_result =
        physics_pool::generate_chapter3({.objects = options.objects, .seed = seed, .table = options.table});
    if (!scene_result) return scene_result.error();
    auto truth_result = physics_pool::World::compile(*scene_result);
    if (!truth_result) return truth_result.error();
    for (FirstPlanSide& side : sides) {
      const auto ok =
          run_in(*scene_result, *truth_result, seed, &side == &sides.back() ? after : before, pool, side, stop);
      if (stop.stop_requested()) return sides;
      if (!ok) return ok.error();
      options.line->step(
          fmt::format("world {}, {}: {:.2f} s", seed, side.name, side.first.empty() ? 0.0 : side.first.back().seconds));
    }
  }
  return sides;
}

std::string to_text(const std::vector<FirstPlanSide>& sides) {
  std::string text;
  for (const FirstPlanSide& side : sides) {
    const std::vector<double> first = seconds_of(side.first), again = seconds_of(side.replans);
    text += fmt::format(
        "{:<17} {} of {} worlds solved; first plan {:.2f} s (90 %: {:.2f} s), {} reach the target; {} re-plans, "
        "{:.2f} s (90 %: {:.2f} s)\n",
        side.name, side.solved, side.worlds, common::median(first), common::quantile(first, 0.9), side.planned,
        again.size(), common::median(again), common::quantile(again, 0.9));
  }
  return text;
}

nlohmann::json to_json(const std::vector<FirstPlanSide>& sides, const FirstPlanOptions& options) {
  nlohmann::json json = to_json(sides.back());
  if (options.before) json["before"] = to_json(sides.front());
  json["first_seed"] = options.first_seed;
  json["objects"] = options.objects;
  json["table"] = options.table;
  json["workers"] = options.workers;
  json["timeout"] = options.timeout;
  json["guidance"] = options.guidance;
  return json;
}

Result<void> bench_first_plan(const FirstPlanOptions& options, const std::filesystem::path& json,
                              const std::filesystem::path& parameters, std::stop_token stop) {
  const auto sides_result = measure_first_plans(options, parameters, stop);
  options.line->end();
  if (!sides_result) return sides_result.error();
  if (stop.stop_requested()) fmt::print("Partial: interrupted.\n");
  fmt::print("{}", to_text(*sides_result));
  if (!json.empty()) {
    nlohmann::json results = to_json(*sides_result, options);
    if (stop.stop_requested()) results["partial"] = true;
    if (auto ok = common::write_results(json, std::move(results)); !ok) return ok;
  }
  return stop.stop_requested() ? Result<void>(Error{Code::kCancelled, "interrupted"}) : Result<void>();
}

namespace {

class FirstPlan final : public Benchmark {
 public:
  FirstPlan()
      : Benchmark("first-plan", "first plans and re-plans of grasps in fresh worlds, without and with guidance",
                  "an hour", Uses::kNothing) {}

  void add_options(CLI::App& app) override {
    app.add_option("--worlds", options_.worlds, "Worlds, one run of each side in each")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    common::add_seed_option(app, "--seed", options_.first_seed, "Seed of the first world; the next ones follow");
    app.add_option("--objects", options_.objects, "Objects beside the target")
        ->capture_default_str()
        ->check(CLI::Range(0, 40));
    app.add_option("--table", options_.table, "Side of the table, m; 0: as dense as in Sec. 3.3.1")
        ->capture_default_str()
        ->check(CLI::Range(0.0, 10.0));
    app.add_option("--workers", options_.workers, "Threads of the pool")
        ->capture_default_str()
        ->check(CLI::Range(1, 1024));
    app.add_option("--timeout", options_.timeout, "Seconds of one run")
        ->capture_default_str()
        ->check(CLI::Range(1.0, 1e6));
    app.add_flag("--no-before{false}", options_.before, "Leave the side without guidance away");
    app.add_option("--guidance", options_.guidance, "Candidates per iteration of the side with guidance")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.line = start.line;
    return exit_code(bench_first_plan(options_, json, common::data_file("experiments/grasping.yaml"), start.stop));
  }

 private:
  FirstPlanOptions options_;
};

}  // namespace

std::unique_ptr<Benchmark> first_plan_benchmark() { return std::make_unique<FirstPlan>(); }

}  // namespace jostle::studies
