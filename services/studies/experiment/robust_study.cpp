#include "services/studies/experiment/robust_study.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>

#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/scenarios/chapter4.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/results/results.hpp"
#include "services/common/results/table.hpp"
#include "services/studies/experiment/options.hpp"
#include "services/studies/experiment/runs.hpp"
#include "services/task/session/composition.hpp"
#include "services/world/in_process/in_process_world.hpp"

namespace jostle::studies {
namespace {

using nlohmann::json;
using planners::Ending;

// Far from the seeds of scenes, which planners draw their worlds and starts by.
constexpr std::uint64_t kExecutionSeeds = 7'000'000'000;

struct Case {
  std::string method;
  std::uint64_t seed = 0;

  std::string name() const { return fmt::format("{} seed {}", method, seed); }
};

json record_of(const Case& one, const planners::Outcome& outcome, double step_duration) {
  const auto metric = [&](planners::Estimate planners::Robustness::*which) {
    const auto& robustness = outcome.first_plan.robustness;
    return robustness ? common::number_or_null(((*robustness).*which).value) : json();
  };
  return {{"seed", one.seed},
          {"method", one.method},
          {"success", outcome.success},
          {"ending", planners::to_string(outcome.ending)},
          {"reason", outcome.reason},
          {"actions", outcome.actions},
          {"open_loop_actions", outcome.open_loop_actions},
          {"mismatches", outcome.mismatches},
          {"rollouts", outcome.rollouts},
          {"plan_rollouts", outcome.first_plan.rollouts},
          {"planning_seconds", outcome.plan_time.count()},
          {"execution_seconds", execution_seconds(outcome, step_duration)},
          {"expected", metric(&planners::Robustness::expected)},
          {"maximal", metric(&planners::Robustness::maximal)},
          {"nominal_expected", metric(&planners::Robustness::nominal_expected)},
          {"nominal_maximal", metric(&planners::Robustness::nominal_maximal)},
          {"realized_expected", metric(&planners::Robustness::realized_expected)},
          {"realized_maximal", metric(&planners::Robustness::realized_maximal)}};
}

json broken_record(const Case& one, const std::string& error) {
  return {{"seed", one.seed},
          {"method", one.method},
          {"success", false},
          {"ending", planners::to_string(Ending::kBroken)},
          {"reason", error}};
}

// The world that a scene is executed in: objects are others than believed, and elsewhere.
physics_pool::Scene execution_scene(const RobustStudy& study, const physics_pool::Scene& believed, std::uint64_t seed) {
  physics_pool::Scene scene = physics_pool::realize(believed, study.bounds, kExecutionSeeds + seed, 1);
  const State x =
      physics_pool::nearby_start(believed, scene, initial_state(believed), study.spread, kExecutionSeeds + seed, 0);
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const double* q = &x.q[static_cast<std::size_t>(layout_of(scene).objects[i].q)];
    scene.objects[i].x = q[0];
    scene.objects[i].y = q[1];
    scene.objects[i].yaw = yaw_of(q + 3);
  }
  return scene;
}

Result<json> perform(const RobustStudy& study, const Case& one, std::stop_token stop) {
  auto believed_result = physics_pool::generate_chapter4({.seed = one.seed});
  if (!believed_result) return believed_result.error();
  auto truth_result = physics_pool::World::compile(execution_scene(study, *believed_result, one.seed));
  if (!truth_result) return truth_result.error();
  physics_pool::ThreadPool pool(1);
  auto run_result = task::Composition::make({.belief = *believed_result,
                                             .belief_is_exact = false,
                                             .parameters = study.parameters,
                                             .controller = one.method,
                                             .seed = one.seed},
                                            pool);
  if (!run_result) return run_result.error();
  physics_pool::ExecutionWorld world(*truth_result);
  world::SimulatedRobot robot(world);
  world::SimulatedObjects objects(world, *believed_result);
  auto outcome_result = run_result->perform(robot, objects, {}, std::move(stop));
  if (!outcome_result) return outcome_result.error();
  return record_of(one, *outcome_result, study.parameters.planner.step_duration);
}

// Runs of one method.
struct Cell : RunGroup {
  std::string method;

  // Of all actions, those that nothing was looked at for.
  double open_share() const {
    double open = 0.0, all = 0.0;
    for (const json* run : runs) open += number(*run, "open_loop_actions"), all += number(*run, "actions");
    return all > 0 ? open / all : common::kNone;
  }
};

// Two methods on the scenes that both were run in.
struct Pair {
  std::string method, other;
  int better = 0, worse = 0;  // scenes in which the first alone succeeded, or the second alone
  common::Mean sooner;        // s of execution, the second's less the first's, where both succeeded

  double p() const { return common::sign_test(better, worse); }
};

Pair compare(const Cell& a, const Cell& b) {
  Pair pair{.method = a.method, .other = b.method};
  std::vector<double> differences;
  for (const json* run : a.runs) {
    const auto other = std::ranges::find_if(b.runs, [&](const json* r) { return (*r)["seed"] == (*run)["seed"]; });
    if (other == b.runs.end()) continue;
    const bool first = (*run)["success"], second = (**other)["success"];
    pair.better += first && !second ? 1 : 0;
    pair.worse += !first && second ? 1 : 0;
    if (first && second)
      differences.push_back(number(**other, "execution_seconds") - number(*run, "execution_seconds"));
  }
  pair.sooner = common::mean_of(differences);
  return pair;
}

class RobustStudyRunner final : public Study {
 public:
  explicit RobustStudyRunner(RobustStudy study) : Study(study.about), study_(std::move(study)) {}

  void add_options(CLI::App& app) override {
    seeds_.add_to(app, study_.first_seed, study_.last_seed);
    app.add_option("--methods", study_.methods, "Only these, such as ocl,cc; the last is compared with the others")
        ->delimiter(',')
        ->check(CLI::IsMember({"ol", "rol", "cp", "cc", "ocl"}));
    app.add_option("--set", changes_, "One parameter, such as robust.worlds=2; may be given again")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    add_jobs_option(app, jobs_, "Runs at a time; more than there are free cores make times longer");
  }

  Result<std::vector<std::string>> prepare() override {
    if (auto ok = seeds_.apply(study_.first_seed, study_.last_seed); !ok) return ok.error();
    auto parameters_result = task::with_settings(study_.parameters, changes_);
    if (!parameters_result) return parameters_result.error();
    study_.parameters = std::move(parameters_result).value();
    std::vector<std::string> names;
    cases_.clear();
    for (std::uint64_t seed = study_.first_seed; seed <= study_.last_seed; ++seed) {
      for (const std::string& method : study_.methods) {
        cases_.push_back({.method = method, .seed = seed});
        names.push_back(cases_.back().name());
      }
    }
    return names;
  }

  json settings() const override { return {{"set", changes_}}; }

  int at_a_time() const override { return jobs_; }

  Result<json> run_case(std::size_t index, std::stop_token stop) override {
    return perform(study_, cases_[index], std::move(stop));
  }

  std::string news_of(const json& run) const override {
    return fmt::format("{}, {} ({} actions, {} of them open-loop; {:.1f} s of planning)",
                       run["ending"].get<std::string>(), run["reason"].get<std::string>(), run["actions"].get<int>(),
                       run["open_loop_actions"].get<int>(), planning(run));
  }

  StudyReport report(const std::vector<json>& records) const override {
    json runs =
        runs_of(records, [this](std::size_t i, const std::string& error) { return broken_record(cases_[i], error); });
    const std::vector<Cell> all = cells(runs);
    json rows = json::array(), compared = json::array();
    for (const Cell& cell : all) rows.push_back(row_of(cell));
    for (const Pair& pair : pairs(all)) {
      json row{{"method", pair.method},
               {"other", pair.other},
               {"alone", pair.better},
               {"other_alone", pair.worse},
               {"p", common::number_or_null(pair.p())}};
      put_mean(row, "sooner_seconds", pair.sooner);
      compared.push_back(std::move(row));
    }
    return {.table = table_of(all),
            .json = {{"title", title()},
                     {"settings", settings()},
                     {"rows", std::move(rows)},
                     {"pairs", std::move(compared)},
                     {"runs", std::move(runs)}}};
  }

  bool has_figure() const override { return true; }

  // Fig. 4.4 a, b, c and e.
  std::vector<common::Panel> figure(const json& report) const override {
    const std::vector<Cell> all = cells(report.at("runs"));
    std::vector<common::Panel> panels;
    const auto add = [&](const char* label, auto value_of) {
      common::Panel panel{.x_label = "method", .y_label = label};
      common::Band band;
      for (const Cell& cell : all) {
        if (cell.runs.empty()) continue;
        const auto [low, middle, high] = value_of(cell);
        band.x.push_back(static_cast<double>(panel.names.size()));
        band.low.push_back(low), band.middle.push_back(middle), band.high.push_back(high);
        panel.names.push_back(cell.method);
      }
      panel.bands.push_back(std::move(band));
      panels.push_back(std::move(panel));
    };
    const auto around = [](const common::Mean& mean) {
      return std::tuple(mean.value - mean.half_width, mean.value, mean.value + mean.half_width);
    };
    add("success", [](const Cell& cell) {
      const common::Share share = cell.share();
      return std::tuple(share.low, double(share.successes) / share.runs, share.high);
    });
    add("planning, s", [&](const Cell& cell) { return around(mean_over(cell.runs, "planning_seconds")); });
    add("execution, s", [&](const Cell& cell) { return around(mean_over(cell.runs, "execution_seconds")); });
    add("open-loop share",
        [](const Cell& cell) { return std::tuple(cell.open_share(), cell.open_share(), cell.open_share()); });
    return panels;
  }

 private:
  std::vector<Cell> cells(const json& runs) const {
    std::vector<Cell> result;
    for (const std::string& method : study_.methods) {
      Cell& cell = result.emplace_back();
      cell.method = method;
      for (const json& run : runs) {
        if (run["method"] == method) cell.add(run);
      }
    }
    return result;
  }

  // The last method with each of the others.
  static std::vector<Pair> pairs(const std::vector<Cell>& all) {
    std::vector<Pair> result;
    for (std::size_t i = 0; i + 1 < all.size(); ++i) result.push_back(compare(all.back(), all[i]));
    return result;
  }

  std::string thesis_of(const std::string& method) const {
    const auto found = study_.thesis.find(method);
    return found == study_.thesis.end() ? "-" : found->second;
  }

  std::string table_of(const std::vector<Cell>& all) const {
    std::vector<std::vector<std::string>> ends{{"method", "success", "95 % interval", "thesis"}};
    std::vector<std::vector<std::string>> costs{{"method", "planning, s", "execution, s", "rollouts", "open-loop"}};
    std::vector<std::vector<std::string>> metrics{{"method", "E real", "E nominal", "E others alone"}};
    std::vector<std::vector<std::string>> against{{"pair", "alone", "other alone", "p", "sooner by, s"}};
    int broken = 0;
    for (const Cell& cell : all) {
      const common::Share share = cell.share();
      broken += cell.broken;
      ends.push_back({cell.method, fmt::format("{}/{}", share.successes, share.runs),
                      common::interval_text(share.low, share.high), thesis_of(cell.method)});
      costs.push_back({cell.method, to_text(mean_over(cell.runs, "planning_seconds"), 1),
                       to_text(mean_over(cell.runs, "execution_seconds"), 1),
                       to_text(mean_over(cell.runs, "rollouts"), 0), common::number_text(cell.open_share(), 2)});
      metrics.push_back({cell.method, to_text(mean_over(cell.runs, "expected"), 2),
                         to_text(mean_over(cell.runs, "nominal_expected"), 2),
                         to_text(mean_over(cell.runs, "realized_expected"), 2)});
    }
    for (const Pair& pair : pairs(all)) {
      against.push_back({pair.method + " and " + pair.other, std::to_string(pair.better), std::to_string(pair.worse),
                         common::number_text(pair.p(), 3), to_text(pair.sooner, 1)});
    }
    std::string text = fmt::format("{}\n\n{}\n{}\n{}\n{}", title(), common::table(ends), common::table(costs),
                                   common::table(metrics), common::table(against));
    text += fmt::format(
        "\nMeans over all runs, with 95 % intervals. Planning: before the first action, on one thread.\n"
        "Execution: {} s for each action, and what was planned in between, for whose time the world\n"
        "stands still. E: expected divergence of the first plan. Pairs: scenes in which one of the two\n"
        "succeeded alone, p by the sign test; sooner: execution, where both succeeded.\n",
        study_.parameters.planner.step_duration);
    if (broken > 0) text += fmt::format("Parts of the system failed in {} more runs, which count nowhere.\n", broken);
    if (!study_.remark.empty()) text += study_.remark + "\n";
    return text;
  }

  json row_of(const Cell& cell) const {
    json row{{"method", cell.method},
             {"open_loop_share", common::number_or_null(cell.open_share())},
             {"thesis", thesis_of(cell.method)}};
    put_share(row, cell);
    for (const char* key : {"planning_seconds", "execution_seconds", "actions", "rollouts", "expected", "maximal",
                            "nominal_expected", "nominal_maximal", "realized_expected", "realized_maximal"}) {
      put_mean(row, key, mean_over(cell.runs, key));
    }
    return row;
  }

  RobustStudy study_;
  SeedsOption seeds_;
  std::vector<std::string> changes_;
  int jobs_ = 1;
  std::vector<Case> cases_;
};

}  // namespace

Result<std::unique_ptr<Study>> read_robust_study(yaml::Fields& fields, const std::string& origin) {
  RobustStudy study{.about = read_about(fields)};
  std::string parameters;
  fields.required("parameters", parameters);
  fields.required("methods", study.methods);
  read_seeds(fields, study.first_seed, study.last_seed);
  fields.section("world", true, [&](yaml::Fields& world) {
    world.required("least_mass", study.bounds.least_mass);
    world.required("most_mass", study.bounds.most_mass);
    world.required("least_friction", study.bounds.least_friction);
    world.required("most_friction", study.bounds.most_friction);
    world.required("size", study.bounds.size);
    world.required("start_position", study.spread.position);
    world.required("start_rotation", study.spread.rotation);
  });
  fields.optional("thesis", study.thesis);
  fields.optional("remark", study.remark);
  if (auto ok = check_methods(study.methods, origin + ": methods"); !ok) return ok.error();
  auto parameters_result = parameters_beside(origin, parameters);
  if (!parameters_result) return parameters_result.error();
  study.parameters = *parameters_result;
  // No clock decides: actions and iterations are what is limited.
  study.parameters.limits.timeout = std::chrono::hours(24);
  return std::unique_ptr<Study>(std::make_unique<RobustStudyRunner>(std::move(study)));
}

}  // namespace jostle::studies
