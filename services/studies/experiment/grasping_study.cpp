#include "services/studies/experiment/grasping_study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <tuple>

#include "idl/text/yaml_fields.hpp"
#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/objective/scorer.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "physics_pool/uncertainty/belief.hpp"
#include "services/common/process/files.hpp"
#include "services/task/session/composition.hpp"
#include "services/world/in_process/in_process_world.hpp"

namespace jostle::studies {
namespace {

using physics_pool::Scene;
using physics_pool::Uncertainty;

GraspingStudy read(yaml::Fields& fields, std::string& parameters) {
  GraspingStudy study;
  fields.required("title", study.title);
  fields.required("parameters", parameters);
  fields.optional("objects", study.objects);
  fields.section("seeds", true, [&](yaml::Fields& seeds) {
    seeds.required("first", study.first_seed);
    seeds.required("last", study.last_seed);
  });
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

Result<planners::Outcome> grasp(const GraspingStudy& study, const GraspingRun& run, double& cost,
                                std::stop_token stop) {
  const Uncertainty level = *physics_pool::parse_uncertainty(run.level);
  auto scene_result = physics_pool::generate_chapter3({.objects = study.objects, .seed = run.seed});
  if (!scene_result) return scene_result.error();
  const Scene& scene = *scene_result;
  const Scene belief = physics_pool::perturb(scene, level, run.seed);
  auto truth_result = physics_pool::World::compile(scene);
  if (!truth_result) return truth_result.error();
  physics_pool::ThreadPool pool(1);
  auto run_result = task::Composition::make({.belief = belief,
                                             .belief_is_exact = level == Uncertainty::kNone,
                                             .parameters = study.parameters,
                                             .controller = run.controller,
                                             .seed = run.seed},
                                            pool);
  if (!run_result) return run_result.error();
  physics_pool::ExecutionWorld world(*truth_result, {.sigma = physics_pool::velocity_noise(level), .seed = run.seed});
  world::SimulatedRobot robot(world);
  world::SimulatedObjects objects(world, belief);
  auto outcome_result = run_result->perform(robot, objects, {}, stop);
  if (outcome_result) {
    cost = execution_cost(run_result->geometry(), study.parameters.objective, outcome_result->observed);
  }
  return outcome_result;
}

template <class Value>
common::Mean mean_over(const std::vector<const GraspingRun*>& runs, Value value) {
  std::vector<double> values;
  for (const GraspingRun* run : runs) values.push_back(value(*run));
  return common::mean_of(values);
}

// Runs of one level and one controller.
struct Cell {
  std::string level, controller;
  std::vector<const GraspingRun*> runs, successes;
};

std::vector<Cell> cells(const GraspingStudy& study, const std::vector<GraspingRun>& runs) {
  std::vector<Cell> result;
  for (const std::string& level : study.levels) {
    for (const std::string& controller : study.controllers) {
      Cell cell{.level = level, .controller = controller};
      for (const GraspingRun& run : runs) {
        if (run.level != level || run.controller != controller) continue;
        cell.runs.push_back(&run);
        if (run.outcome.success) cell.successes.push_back(&run);
      }
      result.push_back(std::move(cell));
    }
  }
  return result;
}

planners::Ending ending_of(const GraspingRun& run) {
  return run.error.empty() ? run.outcome.ending : planners::Ending::kBroken;
}
double replans(const GraspingRun& run) { return run.outcome.replans; }
double seconds(const GraspingRun& run) { return run.outcome.total_time.count(); }
double plan_seconds(const GraspingRun& run) { return run.outcome.plan_time.count(); }
double cost(const GraspingRun& run) { return run.execution_cost; }

common::Share share_of(const Cell& cell) {
  return common::wilson_interval(static_cast<int>(cell.successes.size()), static_cast<int>(cell.runs.size()));
}

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
  explicit GraspingStudyRunner(GraspingStudy study) : study_(std::move(study)) {}

  const std::string& title() const override { return study_.title; }

  Result<StudyReport> run(const StudyOptions& options) override {
    if (!options.models.empty() || options.samples) {
      return Error{Code::kInvalidArgument,
                   "this study has no --models and no --samples, wanted --seeds, --levels, "
                   "--controllers, --timeout"};
    }
    GraspingStudy study = study_;
    if (options.seeds) std::tie(study.first_seed, study.last_seed) = *options.seeds;
    if (!options.levels.empty()) study.levels = options.levels;
    if (!options.controllers.empty()) study.controllers = options.controllers;
    if (options.timeout) study.parameters.limits.timeout = *options.timeout;
    if (auto ok = check(study, "--"); !ok) return ok.error();
    const auto total = study.levels.size() * study.controllers.size() * (study.last_seed - study.first_seed + 1);
    std::size_t done = 0;
    bool broken = false;
    const auto runs = run_study(study, options, [&](const GraspingRun& run) {
      broken = broken || !run.error.empty();
      options.on_progress(fmt::format("[{:>3}/{}] {:<7} {} seed {:<4} {:<7} {} ({:.0f} s, {} re-plans)", ++done, total,
                                      run.level, run.controller, run.seed, run.outcome.success ? "ok" : "FAILED",
                                      run.error.empty() ? run.outcome.reason : run.error,
                                      run.outcome.total_time.count(), run.outcome.replans));
    });
    if (options.stop.stop_requested()) return Error{Code::kCancelled, "experiment: stopped on request"};
    return StudyReport{.table = study_table(study, runs), .json = study_json(study, runs), .broken = broken};
  }

 private:
  GraspingStudy study_;
};

}  // namespace

Result<std::unique_ptr<Study>> read_grasping_study(yaml::Fields& fields, const std::string& origin) {
  std::string parameters;
  GraspingStudy study = read(fields, parameters);
  auto parameters_result = task::load_parameters(std::filesystem::path(origin).parent_path() / parameters);
  if (!parameters_result) return parameters_result.error();
  study.parameters = *parameters_result;
  if (auto ok = check(study, origin + ": "); !ok) return ok.error();
  return std::unique_ptr<Study>(std::make_unique<GraspingStudyRunner>(std::move(study)));
}

std::vector<GraspingRun> run_study(const GraspingStudy& study, const StudyOptions& options,
                                   const std::function<void(const GraspingRun&)>& on_run) {
  std::vector<GraspingRun> runs;
  for (const std::string& level : study.levels) {
    for (const std::string& controller : study.controllers) {
      for (std::uint64_t seed = study.first_seed; seed <= study.last_seed; ++seed) {
        runs.push_back({.seed = seed, .level = level, .controller = controller});
      }
    }
  }
  std::mutex reporting;
  run_side_by_side(runs.size(), options.jobs, options.stop, [&](std::size_t i) {
    GraspingRun& run = runs[i];
    auto outcome_result = grasp(study, run, run.execution_cost, options.stop);
    if (outcome_result) {
      run.outcome = std::move(outcome_result).value();
    } else {
      run.error = outcome_result.error().message;
    }
    const std::lock_guard lock(reporting);
    on_run(run);
  });
  return runs;
}

std::string study_table(const GraspingStudy& study, const std::vector<GraspingRun>& runs) {
  std::string text = study.title + "\n\n";
  text += fmt::format("{:<8}{:<12}{:<10}{:<16}{:<9}{:<16}{:<18}{:<16}{}\n", "level", "controller", "success",
                      "95 % interval", "thesis", "re-plans", "execution cost", "plan, s", "total, s");
  for (const Cell& cell : cells(study, runs)) {
    const common::Share share = share_of(cell);
    std::string thesis = "-";
    if (const auto level = study.thesis.find(cell.level); level != study.thesis.end()) {
      if (const auto rate = level->second.find(cell.controller); rate != level->second.end()) {
        thesis = fmt::format("{:.2f}", rate->second);
      }
    }
    const auto with_interval = [&](auto value, int digits) {
      const common::Mean mean = mean_over(cell.successes, value);
      return fmt::format("{:.{}f} ± {:.{}f}", mean.value, digits, mean.half_width, digits);
    };
    text += fmt::format("{:<8}{:<12}{:<10}{:<16}{:<9}{:<16}{:<18}{:<16}{}\n", cell.level, cell.controller,
                        fmt::format("{}/{}", share.successes, share.runs),
                        fmt::format("{:.2f} to {:.2f}", share.low, share.high), thesis, with_interval(replans, 1),
                        with_interval(cost, 0), with_interval(plan_seconds, 1), with_interval(seconds, 1));
  }
  text +=
      "\nRe-plans, cost and times: mean of the successful runs and 95 % interval of the mean;\n"
      "one thread per run. The world stands still while its planner thinks.\n";
  return text;
}

nlohmann::json study_json(const GraspingStudy& study, const std::vector<GraspingRun>& runs) {
  nlohmann::json json{{"title", study.title}, {"objects", study.objects}};
  for (const Cell& cell : cells(study, runs)) {
    const common::Share share = share_of(cell);
    json["rows"].push_back({{"level", cell.level},
                            {"controller", cell.controller},
                            {"successes", share.successes},
                            {"runs", share.runs},
                            {"interval", {share.low, share.high}},
                            {"replans", mean_over(cell.successes, replans).value},
                            {"execution_cost", mean_over(cell.successes, cost).value},
                            {"plan_seconds", mean_over(cell.successes, plan_seconds).value},
                            {"total_seconds", mean_over(cell.successes, seconds).value}});
  }
  for (const GraspingRun& run : runs) {
    const planners::Outcome& outcome = run.outcome;
    json["runs"].push_back({{"seed", run.seed},
                            {"level", run.level},
                            {"controller", run.controller},
                            {"success", outcome.success},
                            {"ending", planners::to_string(ending_of(run))},
                            {"reason", run.error.empty() ? outcome.reason : run.error},
                            {"plan_hash", to_string(hash_of(outcome.first_plan.controls.values))},
                            {"plan_seconds", outcome.plan_time.count()},
                            {"total_seconds", outcome.total_time.count()},
                            {"replans", outcome.replans},
                            {"actions", outcome.actions},
                            {"rollouts", outcome.rollouts},
                            {"execution_cost", run.execution_cost}});
  }
  return json;
}

}  // namespace jostle::studies
