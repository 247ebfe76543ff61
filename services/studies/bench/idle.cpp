#include "services/studies/bench/idle.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <nlohmann/json.hpp>

#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "physics_pool/scenarios/chapter5.hpp"
#include "physics_pool/scenarios/push.hpp"
#include "physics_pool/uncertainty/belief.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/results/results.hpp"
#include "services/common/results/table.hpp"
#include "services/studies/bench/catalogue.hpp"
#include "services/task/session/composition.hpp"
#include "services/world/in_process/in_process_world.hpp"

namespace jostle::studies {
namespace {

using physics_pool::AdaptiveTask;
using physics_pool::Scene;
using physics_pool::Uncertainty;

struct Kind {
  const char *controller, *world;
  Result<Scene> (*scene)(std::uint64_t seed);
  bool is_noisy;      // Eq. 5.10; else it is a world of low uncertainty (Sec. 3.3.1)
  const char* label;  // of the row
};

template <AdaptiveTask task>
Result<Scene> chapter5(std::uint64_t seed) {
  return physics_pool::generate_chapter5({.task = task, .seed = seed});
}

Result<Scene> chapter6(std::uint64_t seed) { return physics_pool::generate_chapter6({.seed = seed}); }

Result<Scene> chapter3(std::uint64_t seed) { return physics_pool::generate_chapter3({.objects = 5, .seed = seed}); }

constexpr std::array kKinds{
    Kind{"tampc", "wide table", chapter5<AdaptiveTask::kWide>, true, "tampc-wide"},
    Kind{"tampc", "strip", chapter5<AdaptiveTask::kStrip>, true, "tampc-strip"},
    Kind{"uampc", "strip", chapter5<AdaptiveTask::kStrip>, true, "uampc-strip"},
    Kind{"mpc", "round an obstacle", chapter6, false, "mpc"},
    Kind{"or", "5 objects", chapter3, false, "or"},
};

const Kind& kind_of(const std::string& label) {
  return *std::ranges::find(kKinds, label, [](const Kind& kind) { return std::string(kind.label); });
}

Result<IdleRun> run_in(const Kind& kind, std::uint64_t seed, double nearness, const IdleOptions& options,
                       physics_pool::Pool& pool, std::stop_token stop) {
  auto scene_result = kind.scene(seed);
  if (!scene_result) return scene_result.error();
  const Uncertainty level = kind.is_noisy ? Uncertainty::kNone : Uncertainty::kLow;
  const Scene belief = physics_pool::perturb(*scene_result, level, seed);
  auto truth_result = physics_pool::World::compile(*scene_result);
  if (!truth_result) return truth_result.error();
  auto controller_result = planners::find_controller(kind.controller, belief);
  if (!controller_result) return controller_result.error();
  auto parameters_result = task::standard_parameters(**controller_result);
  if (!parameters_result) return parameters_result.error();
  task::Parameters& parameters = *parameters_result;
  parameters.limits.timeout = std::chrono::milliseconds(static_cast<long>(1e3 * options.timeout));
  parameters.plan_while_acting = nearness;
  if (kind.is_noisy) parameters.controller.adaptive.noise = options.noise;
  auto run_result = task::Composition::make({.belief = belief,
                                             .belief_is_exact = level == Uncertainty::kNone,
                                             .parameters = parameters,
                                             .controller = kind.controller,
                                             .seed = seed},
                                            pool);
  if (!run_result) return run_result.error();
  physics_pool::ExecutionWorld world(
      *truth_result,
      {.sigma = physics_pool::velocity_noise(level), .slope = kind.is_noisy ? options.noise : 0.0, .seed = seed});
  world::SimulatedRobot robot(world, options.rate);
  world::SimulatedObjects objects(world, belief);
  auto outcome_result = run_result->perform(robot, objects, {}, std::move(stop));
  if (!outcome_result) return outcome_result.error();
  const planners::Outcome& outcome = *outcome_result;
  return IdleRun{.seed = seed,
                 .success = outcome.success,
                 .reason = outcome.reason,
                 .actions = outcome.actions,
                 .plans_ahead = outcome.plans_ahead,
                 .taken_ahead = outcome.taken_ahead,
                 .rollouts = outcome.rollouts,
                 .abandoned_rollouts = outcome.abandoned_rollouts,
                 .seconds = outcome.total_time.count(),
                 .idle = planners::idle_between(outcome)};
}

// Over all runs of a side.
struct Summary {
  explicit Summary(const std::vector<IdleRun>& runs) {
    std::vector<double> idle, seconds;
    int successes = 0;
    for (const IdleRun& run : runs) {
      idle.insert(idle.end(), run.idle.begin(), run.idle.end());
      seconds.push_back(run.seconds);
      successes += run.success ? 1 : 0;
      actions += run.actions;
      ahead += run.plans_ahead;
      taken += run.taken_ahead;
    }
    success = common::wilson_interval(successes, static_cast<int>(runs.size()));
    median = common::median(idle);
    p90 = common::quantile(idle, 0.9);
    total = common::mean_of(seconds);
  }

  common::Share success;
  int actions = 0, ahead = 0, taken = 0;
  double median = 0.0, p90 = 0.0;  // s
  common::Mean total;              // s
};

std::string shown(double seconds) { return std::isfinite(seconds) ? fmt::format("{:.2f}", seconds) : "-"; }

nlohmann::json to_json(const std::vector<IdleRun>& runs) {
  const Summary summary(runs);
  nlohmann::json json{
      {"successes", summary.success.successes},
      {"runs", summary.success.runs},
      {"interval", {common::number_or_null(summary.success.low), common::number_or_null(summary.success.high)}},
      {"idle_median", common::number_or_null(summary.median)},
      {"idle_p90", common::number_or_null(summary.p90)},
      {"total_seconds", common::number_or_null(summary.total.value)},
      {"plans_while_acting", summary.ahead},
      {"taken_while_acting", summary.taken},
      {"all", nlohmann::json::array()}};
  for (const IdleRun& run : runs) {
    json["all"].push_back({{"seed", run.seed},
                           {"success", run.success},
                           {"reason", run.reason},
                           {"actions", run.actions},
                           {"plans_while_acting", run.plans_ahead},
                           {"taken_while_acting", run.taken_ahead},
                           {"rollouts", run.rollouts},
                           {"abandoned_rollouts", run.abandoned_rollouts},
                           {"total_seconds", run.seconds},
                           {"idle", run.idle}});
  }
  return json;
}

}  // namespace

std::vector<std::string> idle_rows() {
  std::vector<std::string> names;
  for (const Kind& kind : kKinds) names.emplace_back(kind.label);
  return names;
}

Result<std::vector<IdleRow>> measure_idle(const IdleOptions& options, std::stop_token stop) {
  physics_pool::ThreadPool pool(options.workers);
  std::vector<IdleRow> rows;
  for (const std::string& name : options.rows.empty() ? idle_rows() : options.rows) {
    const Kind& kind = kind_of(name);
    rows.push_back({.name = name, .controller = kind.controller, .world = kind.world});
  }
  options.line->expect(2 * rows.size() * static_cast<std::size_t>(options.worlds));
  for (int i = 0; i < options.worlds; ++i) {
    const std::uint64_t seed = options.first_seed + static_cast<std::uint64_t>(i);
    for (IdleRow& row : rows) {
      std::array sides{&row.before, &row.after};
      if (i % 2 == 1) std::swap(sides[0], sides[1]);
      for (std::vector<IdleRun>* side : sides) {
        const double nearness = side == &row.after ? options.nearness : 0.0;
        auto run_result = run_in(kind_of(row.name), seed, nearness, options, pool, stop);
        if (stop.stop_requested()) return rows;
        if (!run_result) return run_result.error();
        side->push_back(std::move(run_result).value());
        options.line->step(fmt::format("{}, seed {}, {}: {} s idle", row.name, seed,
                                       side == &row.after ? "while acting" : "standing",
                                       shown(common::median(side->back().idle))));
      }
    }
  }
  return rows;
}

std::string to_text(const std::vector<IdleRow>& rows) {
  std::vector<std::vector<std::string>> cells{{"controller", "world", "plans", "success", "95 % interval", "actions",
                                               "idle, s", "90 %, s", "begun", "taken", "run, s"}};
  for (const IdleRow& row : rows) {
    for (const bool is_after : {false, true}) {
      const Summary side(is_after ? row.after : row.before);
      cells.push_back({row.controller, row.world, is_after ? "while acting" : "standing",
                       fmt::format("{}/{}", side.success.successes, side.success.runs),
                       common::interval_text(side.success.low, side.success.high), std::to_string(side.actions),
                       shown(side.median), shown(side.p90), std::to_string(side.ahead), std::to_string(side.taken),
                       shown(side.total.value)});
    }
  }
  return common::table(cells);
}

nlohmann::json to_json(const std::vector<IdleRow>& rows, const IdleOptions& options) {
  nlohmann::json json{
      {"first_seed", options.first_seed}, {"worlds", options.worlds},       {"nearness", options.nearness},
      {"noise", options.noise},           {"rate", options.rate},           {"workers", options.workers},
      {"timeout", options.timeout},       {"rows", nlohmann::json::array()}};
  for (const IdleRow& row : rows) {
    json["rows"].push_back({{"name", row.name},
                            {"controller", row.controller},
                            {"world", row.world},
                            {"standing", to_json(row.before)},
                            {"while_acting", to_json(row.after)}});
  }
  return json;
}

Result<void> bench_idle(const IdleOptions& options, const std::filesystem::path& json, std::stop_token stop) {
  const auto rows_result = measure_idle(options, stop);
  options.line->end();
  if (!rows_result) return rows_result.error();
  if (stop.stop_requested()) fmt::print("Partial: interrupted.\n");
  fmt::print("{}", to_text(*rows_result));
  fmt::print(
      "\nidle: seconds that the robot stands still before an action, the first one left out (median, and 90 %).\n"
      "begun, taken: plans begun while the robot acts, and those of them that were near enough to be used.\n");
  if (!json.empty()) {
    nlohmann::json results = to_json(*rows_result, options);
    if (stop.stop_requested()) results["partial"] = true;
    if (auto ok = common::write_results(json, std::move(results)); !ok) return ok;
  }
  return stop.stop_requested() ? Result<void>(Error{Code::kCancelled, "interrupted"}) : Result<void>();
}

namespace {

class Idle final : public Benchmark {
 public:
  Idle()
      : Benchmark("idle",
                  "how long robots stand still before their actions, with plans made meanwhile and while they act",
                  "an hour", Uses::kNothing) {}

  void add_options(CLI::App& app) override {
    app.add_option("--rows", options_.rows, "Only these, such as tampc-strip,mpc")
        ->delimiter(',')
        ->check(CLI::IsMember(idle_rows()));
    app.add_option("--worlds", options_.worlds, "Worlds of each row, and one run of each side in each")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    common::add_seed_option(app, "--seed", options_.first_seed, "Seed of the first world; the next ones follow");
    app.add_option("--nearness", options_.nearness, "control.plan_while_acting of the side that has it, m")
        ->capture_default_str()
        ->check(CLI::Range(1e-9, 1e3));
    app.add_option("--noise", options_.noise, "Slope b of the noise in the worlds of Ch. 5")
        ->capture_default_str()
        ->check(CLI::Range(0.0, 1.0));
    app.add_option("--rate", options_.rate, "World seconds per second while acting")
        ->capture_default_str()
        ->check(CLI::Range(0.01, 1e3));
    app.add_option("--workers", options_.workers, "Threads of the pool")
        ->capture_default_str()
        ->check(CLI::Range(1, 1024));
    app.add_option("--timeout", options_.timeout, "Seconds of one run")
        ->capture_default_str()
        ->check(CLI::Range(1.0, 1e6));
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.line = start.line;
    return exit_code(bench_idle(options_, json, start.stop));
  }

 private:
  IdleOptions options_;
};

}  // namespace

std::unique_ptr<Benchmark> idle_benchmark() { return std::make_unique<Idle>(); }

}  // namespace jostle::studies
