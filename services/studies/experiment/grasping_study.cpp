#include "services/studies/experiment/grasping_study.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/objective/scorer.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "physics_pool/uncertainty/belief.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/files.hpp"
#include "services/common/results/results.hpp"
#include "services/common/results/table.hpp"
#include "services/studies/experiment/options.hpp"
#include "services/studies/experiment/runs.hpp"
#include "services/task/session/composition.hpp"
#include "services/world/in_process/in_process_world.hpp"

namespace jostle::studies {
namespace {

using nlohmann::json;
using physics_pool::Scene;
using physics_pool::Uncertainty;
using planners::Ending;

GraspingStudy read(yaml::Fields& fields, std::string& parameters) {
  GraspingStudy study{.about = read_about(fields)};
  fields.required("parameters", parameters);
  fields.optional("objects", study.objects);
  read_seeds(fields, study.first_seed, study.last_seed);
  fields.optional("levels", study.levels);
  fields.optional("controllers", study.controllers);
  fields.optional("thesis", study.thesis);
  return study;
}

double execution_cost(const physics_pool::TaskGeometry& geometry, const physics_pool::Objective& objective,
                      const Trajectory& states) {
  const std::vector<double> still(static_cast<std::size_t>(geometry.layout.nu), 0.0);
  const physics_pool::Scorer scorer(objective);
  double sum = scorer.final(geometry, states.back());
  for (std::size_t t = 0; t + 1 < states.size(); ++t) {
    sum += scorer.running({.geometry = geometry, .u_before = still, .u = still, .x0 = states[t], .x1 = states[t + 1]});
  }
  return sum;
}

// One scene to be planned and executed.
struct Case {
  std::string level, controller;
  std::uint64_t seed = 0;

  std::string name() const { return fmt::format("{} {} seed {}", level, controller, seed); }
};

// Of what was executed.
struct Measured {
  int others_in_hand = 0;                 // between the fingers at the end, beside the target
  double execution_seconds = 0.0;         // after the first plan: planning, and what each action takes (Fig. 3.5d)
  double execution_cost = common::kNone;  // nothing was executed, nothing has a cost
};

// A run's numbers; those that were not come to be are null.
json record_of(const Case& one, const planners::Outcome& outcome, const Measured& measured) {
  const bool has_plan = !outcome.first_plan.controls.values.empty();
  return {{"seed", one.seed},
          {"level", one.level},
          {"controller", one.controller},
          {"success", outcome.success},
          {"ending", planners::to_string(outcome.ending)},
          {"reason", outcome.reason},
          {"plan_hash", has_plan ? json(to_string(hash_of(outcome.first_plan.controls.values))) : json()},
          {"plan_seconds", has_plan ? json(outcome.plan_time.count()) : json()},
          {"planning_seconds", outcome.planning_time.count()},
          {"total_seconds", outcome.total_time.count()},
          {"replans", outcome.replans},
          {"actions", outcome.actions},
          {"rollouts", outcome.rollouts},
          {"others_in_hand", measured.others_in_hand},
          {"execution_seconds", measured.execution_seconds},
          {"execution_cost", common::number_or_null(measured.execution_cost)}};
}

json record_of(const Case& one, const std::string& error) {
  json record = record_of(one, planners::Outcome{.ending = Ending::kBroken, .reason = error}, {});
  for (const char* key :
       {"planning_seconds", "total_seconds", "replans", "actions", "rollouts", "others_in_hand", "execution_seconds"}) {
    record[key] = nullptr;
  }
  return record;
}

Result<json> grasp(const GraspingStudy& study, const Case& one, std::stop_token stop) {
  const Uncertainty level = *physics_pool::parse_uncertainty(one.level);
  auto scene_result = physics_pool::generate_chapter3({.objects = study.objects, .seed = one.seed});
  if (!scene_result) return scene_result.error();
  const Scene& scene = *scene_result;
  const Scene belief = physics_pool::perturb(scene, level, one.seed);
  auto truth_result = physics_pool::World::compile(scene);
  if (!truth_result) return truth_result.error();
  physics_pool::ThreadPool pool(1);
  auto run_result = task::Composition::make({.belief = belief,
                                             .belief_is_exact = level == Uncertainty::kNone,
                                             .parameters = study.parameters,
                                             .controller = one.controller,
                                             .seed = one.seed},
                                            pool);
  if (!run_result) return run_result.error();
  physics_pool::ExecutionWorld world(*truth_result, {.sigma = physics_pool::velocity_noise(level), .seed = one.seed});
  world::SimulatedRobot robot(world);
  world::SimulatedObjects objects(world, belief);
  auto outcome_result = run_result->perform(robot, objects, {}, stop);
  if (!outcome_result) return outcome_result.error();
  const planners::Outcome& outcome = *outcome_result;
  Measured measured{.others_in_hand = count_obstructions(run_result->geometry(), outcome.observed.back()),
                    .execution_seconds = execution_seconds(outcome, study.parameters.planner.step_duration)};
  if (outcome.actions > 0) {
    measured.execution_cost = execution_cost(run_result->geometry(), study.parameters.objective, outcome.observed);
  }
  return record_of(one, outcome, measured);
}

// Runs of one level and one controller.
struct Cell {
  std::string level, controller;
  int runs = 0, timed_out = 0, broken = 0;  // runs: that came to an end, whatever it was; broken ones did not
  int alone = 0;                            // successes with nothing but the target between the fingers
  std::vector<const json*> successes;

  void add(const json& run) {
    const std::string ending = run["ending"];
    if (ending == planners::to_string(Ending::kBroken)) {
      ++broken;
      return;
    }
    ++runs;
    if (run["success"]) {
      successes.push_back(&run);
      alone += run["others_in_hand"] == 0 ? 1 : 0;
    }
    if (ending == planners::to_string(Ending::kTimedOut)) ++timed_out;
  }

  common::Share share() const { return common::wilson_interval(static_cast<int>(successes.size()), runs); }

  common::Mean over_successes(const char* key) const { return mean_over(successes, key); }
};

// Levels and controllers that exist; `where` they were asked for.
Result<void> check(const GraspingStudy& study, const std::string& where) {
  for (const std::string& level : study.levels) {
    if (auto ok = physics_pool::parse_uncertainty(level); !ok) {
      return Error{Code::kInvalidArgument, fmt::format("{}levels: {}", where, ok.error().message)};
    }
  }
  const auto scene_result = physics_pool::generate_chapter3({.objects = 0, .seed = 1});
  if (!scene_result) return scene_result.error();
  for (const std::string& controller : study.controllers) {
    if (auto ok = planners::find_controller(controller, *scene_result); !ok) {
      const std::string& message = ok.error().message;  // "controller: got …"
      return Error{Code::kInvalidArgument, fmt::format("{}controllers{}", where, message.substr(message.find(':')))};
    }
  }
  return {};
}

class GraspingStudyRunner final : public Study {
 public:
  explicit GraspingStudyRunner(GraspingStudy study) : Study(study.about), study_(std::move(study)) {}

  void add_options(CLI::App& app) override {
    add_jobs_option(app, jobs_);
    seeds_.add_to(app, study_.first_seed, study_.last_seed);
    app.add_option("--levels", study_.levels, "Uncertainty levels: none, low, medium, high")
        ->delimiter(',')
        ->capture_default_str();
    app.add_option("--controllers", study_.controllers, planners::controller_help())
        ->delimiter(',')
        ->capture_default_str();
    add_timeout_option(app, timeout_);
  }

  Result<std::vector<std::string>> prepare() override {
    if (auto ok = seeds_.apply(study_.first_seed, study_.last_seed); !ok) return ok.error();
    if (auto ok = check(study_, "--"); !ok) return ok.error();
    if (timeout_) study_.parameters.limits.timeout = std::chrono::milliseconds(std::llround(*timeout_ * 1e3));
    std::vector<std::string> names;
    cases_.clear();
    // Whatever part was run compares all levels and controllers on equal scenes.
    for (std::uint64_t seed = study_.first_seed; seed <= study_.last_seed; ++seed) {
      for (const std::string& level : study_.levels) {
        for (const std::string& controller : study_.controllers) {
          cases_.push_back({level, controller, seed});
          names.push_back(cases_.back().name());
        }
      }
    }
    return names;
  }

  json settings() const override { return {{"timeout_s", timeout_ ? json(*timeout_) : json()}}; }
  int at_a_time() const override { return jobs_; }

  Result<json> run_case(std::size_t index, std::stop_token stop) override {
    return grasp(study_, cases_[index], std::move(stop));
  }

  std::string news_of(const json& run) const override {
    return fmt::format("{}, {} ({:.0f} s, {} re-plans)", run["ending"].get<std::string>(),
                       run["reason"].get<std::string>(), run["total_seconds"].get<double>(), run["replans"].get<int>());
  }

  StudyReport report(const std::vector<json>& records) const override {
    std::vector<json> runs =
        runs_of(records, [this](std::size_t i, const std::string& error) { return record_of(cases_[i], error); });
    const std::vector<Cell> all = cells(runs);
    return {.table = table_of(all), .json = json_of(all, runs)};
  }

 private:
  std::vector<Cell> cells(const std::vector<json>& runs) const {
    std::vector<Cell> result;
    for (const std::string& level : study_.levels) {
      for (const std::string& controller : study_.controllers) {
        Cell cell{.level = level, .controller = controller};
        for (const json& run : runs) {
          if (run["level"] == level && run["controller"] == controller) cell.add(run);
        }
        result.push_back(std::move(cell));
      }
    }
    return result;
  }

  std::string thesis_of(const Cell& cell) const {
    const auto level = study_.thesis.find(cell.level);
    if (level == study_.thesis.end()) return "-";
    const auto rate = level->second.find(cell.controller);
    return rate == level->second.end() ? "-" : fmt::format("{:.2f}", rate->second);
  }

  std::string table_of(const std::vector<Cell>& all) const {
    std::vector<std::vector<std::string>> ends{
        {"level", "controller", "success", "95 % interval", "thesis", "target alone", "timed out"}};
    std::vector<std::vector<std::string>> means{
        {"level", "controller", "re-plans", "execution cost", "first plan, s", "execution, s", "total, s"}};
    int broken = 0;
    for (const Cell& cell : all) {
      const common::Share share = cell.share();
      broken += cell.broken;
      ends.push_back({cell.level, cell.controller, fmt::format("{}/{}", share.successes, share.runs),
                      common::interval_text(share.low, share.high), thesis_of(cell),
                      fmt::format("{}/{}", cell.alone, share.runs), std::to_string(cell.timed_out)});
      means.push_back(
          {cell.level, cell.controller, to_text(cell.over_successes("replans"), 1),
           to_text(cell.over_successes("execution_cost"), 0), to_text(cell.over_successes("plan_seconds"), 1),
           to_text(cell.over_successes("execution_seconds"), 1), to_text(cell.over_successes("total_seconds"), 1)});
    }
    std::string text = fmt::format("{}\n\n{}\n{}", title(), common::table(ends), common::table(means));
    text +=
        "\nRe-plans, cost and times: mean of the successful runs, and 95 % interval of the mean where there\n"
        "are two or more. One thread per run. The world stands still while its planner thinks. Target\n"
        "alone: successes without another object between the fingers. Execution: planning after the first\n"
        "plan, and what the actions take (Fig. 3.5d); total: by the clock, simulated actions included.\n";
    if (broken > 0) text += fmt::format("Parts of the system failed in {} more runs, which count nowhere.\n", broken);
    return text;
  }

  json json_of(const std::vector<Cell>& all, const std::vector<json>& runs) const {
    json result{{"title", title()}, {"objects", study_.objects}, {"rows", json::array()}, {"runs", runs}};
    for (const Cell& cell : all) {
      const common::Share share = cell.share();
      json row{{"level", cell.level},
               {"controller", cell.controller},
               {"successes", share.successes},
               {"runs", share.runs},
               {"target_alone", cell.alone},
               {"timed_out", cell.timed_out},
               {"broken", cell.broken},
               {"interval", {common::number_or_null(share.low), common::number_or_null(share.high)}}};
      for (const char* key : {"replans", "execution_cost", "plan_seconds", "execution_seconds", "total_seconds"}) {
        put_mean(row, key, cell.over_successes(key));
      }
      result["rows"].push_back(std::move(row));
    }
    return result;
  }

  GraspingStudy study_;
  int jobs_ = 1;
  SeedsOption seeds_;
  std::optional<double> timeout_;  // s
  std::vector<Case> cases_;
};

}  // namespace

Result<std::unique_ptr<Study>> read_grasping_study(yaml::Fields& fields, const std::string& origin) {
  std::string parameters;
  GraspingStudy study = read(fields, parameters);
  auto parameters_result = parameters_beside(origin, parameters);
  if (!parameters_result) return parameters_result.error();
  study.parameters = *parameters_result;
  if (auto ok = check(study, origin + ": "); !ok) return ok.error();
  return std::unique_ptr<Study>(std::make_unique<GraspingStudyRunner>(std::move(study)));
}

}  // namespace jostle::studies
