#include "services/experiment/grasping_study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/scene/yaml_fields.hpp"
#include "services/simulation/in_process_world.hpp"
#include "services/support/files.hpp"

namespace jostle::services {
namespace {

using physics_pool::Scene;
using physics_pool::Uncertainty;

GraspingStudy read(const YAML::Node& root, const std::string& origin, std::string& parameters) {
  GraspingStudy study;
  yaml::Fields fields(root, "", origin);
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
  fields.finish();
  return study;
}

double execution_cost(const physics_pool::TaskGeometry& geometry,
                      const physics_pool::Objective& objective, const Trajectory& states) {
  const std::vector<double> still(kGripperAxes, 0.0);
  double sum = physics_pool::final_cost(geometry, objective, states.back());
  for (std::size_t t = 0; t + 1 < states.size(); ++t) {
    sum += physics_pool::running_cost(geometry, objective, still, still, states[t], states[t + 1]);
  }
  return sum;
}

Result<planners::Outcome> grasp(const GraspingStudy& study, const GraspingRun& run, double& cost) {
  const Uncertainty level = *physics_pool::parse_uncertainty(run.level);
  auto scene_result = physics_pool::generate_chapter3({.objects = study.objects, .seed = run.seed});
  if (!scene_result) return scene_result.error();
  const Scene& scene = *scene_result;
  const Scene belief = physics_pool::perturb(scene, level, run.seed);
  auto truth_result = physics_pool::World::compile(scene);
  if (!truth_result) return truth_result.error();
  auto believed_result = physics_pool::World::compile(belief);
  if (!believed_result) return believed_result.error();
  const physics_pool::WorldPtr believed = *believed_result;

  physics_pool::ThreadPool pool(1);
  auto hash_result = pool.load(belief);
  if (!hash_result) return hash_result.error();
  physics_pool::ExecutionWorld world(*truth_result, physics_pool::velocity_noise(level), run.seed);
  SimulatedRobot robot(world);
  SimulatedObjects objects(world, belief);
  planners::Pbsto planner(pool, study.parameters.planner);
  planners::ControlSetup setup{.planner = planner,
                               .robot = robot,
                               .objects = objects,
                               .geometry = believed->geometry(),
                               .objective = study.parameters.planner.objective,
                               .world = *hash_result,
                               .seed = run.seed};
  if (level != Uncertainty::kNone) {
    setup.make_feasible = [&believed](const State& x) { return physics_pool::separate(*believed, x); };
  }
  planners::ControlOptions options = study.parameters.control;
  options.method = run.controller == "or" ? planners::ControlOptions::Method::kOnline
                                          : planners::ControlOptions::Method::kNaive;
  auto outcome_result = planners::run_controller(setup, options);
  if (outcome_result) {
    cost = execution_cost(believed->geometry(), setup.objective, outcome_result->observed);
  }
  return outcome_result;
}

struct Mean {
  double value = 0.0, half_width = 0.0;  // 95 % interval, normal approximation
};

template <class Value>
Mean mean_of(const std::vector<const GraspingRun*>& runs, Value value) {
  if (runs.empty()) return {};
  const double n = static_cast<double>(runs.size());
  double sum = 0.0, squares = 0.0;
  for (const GraspingRun* run : runs) sum += value(*run);
  for (const GraspingRun* run : runs) squares += std::pow(value(*run) - sum / n, 2);
  const double deviation = n > 1 ? std::sqrt(squares / (n - 1)) : 0.0;
  return {.value = sum / n, .half_width = 1.96 * deviation / std::sqrt(n)};
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

double replans(const GraspingRun& run) { return run.outcome.replans; }
double seconds(const GraspingRun& run) { return run.outcome.total_time.count(); }
double plan_seconds(const GraspingRun& run) { return run.outcome.plan_time.count(); }
double cost(const GraspingRun& run) { return run.execution_cost; }

Share share_of(const Cell& cell) {
  return wilson_interval(static_cast<int>(cell.successes.size()), static_cast<int>(cell.runs.size()));
}

}  // namespace

Result<GraspingStudy> load_grasping_study(const std::string& name) {
  const auto file = data_file("experiments/" + name + ".yaml");
  auto text_result = read_text(file);
  if (!text_result) {
    return Error{Code::kNotFound, fmt::format("experiment: got '{}', wanted one of `jostle experiment "
                                              "list` ({})", name, text_result.error().message)};
  }
  return yaml::parse<GraspingStudy>(*text_result, file.string(), [&](const YAML::Node& root) -> Result<GraspingStudy> {
    std::string parameters_file;
    GraspingStudy study = read(root, file.string(), parameters_file);
    auto parameters_result = load_parameters(file.parent_path() / parameters_file);
    if (!parameters_result) return parameters_result.error();
    study.parameters = *parameters_result;
    for (const std::string& level : study.levels) {
      if (auto ok = physics_pool::parse_uncertainty(level); !ok) return ok.error();
    }
    for (const std::string& controller : study.controllers) {
      if (controller != "or" && controller != "nr") {
        return Error{Code::kInvalidArgument,
                     fmt::format("{}: controllers: got '{}', wanted or, nr", file.string(), controller)};
      }
    }
    return study;
  });
}

std::vector<GraspingRun> run_study(const GraspingStudy& study, int jobs,
                                   const std::function<void(const GraspingRun&)>& on_run) {
  std::vector<GraspingRun> runs;
  for (const std::string& level : study.levels) {
    for (const std::string& controller : study.controllers) {
      for (std::uint64_t seed = study.first_seed; seed <= study.last_seed; ++seed) {
        runs.push_back({.seed = seed, .level = level, .controller = controller});
      }
    }
  }
  std::atomic<std::size_t> next = 0;
  std::mutex reporting;
  const auto work = [&] {
    for (std::size_t i = next++; i < runs.size(); i = next++) {
      GraspingRun& run = runs[i];
      auto outcome_result = grasp(study, run, run.execution_cost);
      if (outcome_result) {
        run.outcome = std::move(outcome_result).value();
      } else {
        run.error = outcome_result.error().message;
      }
      const std::lock_guard lock(reporting);
      if (on_run) on_run(run);
    }
  };
  std::vector<std::jthread> threads;
  for (int i = 0; i < std::max(jobs, 1); ++i) threads.emplace_back(work);
  threads.clear();
  return runs;
}

std::string study_table(const GraspingStudy& study, const std::vector<GraspingRun>& runs) {
  std::string text = study.title + "\n\n";
  text += fmt::format("{:<8}{:<12}{:<10}{:<16}{:<9}{:<16}{:<18}{:<16}{}\n", "level", "controller",
                      "success", "95 % interval", "thesis", "re-plans", "execution cost",
                      "plan, s", "total, s");
  for (const Cell& cell : cells(study, runs)) {
    const Share share = share_of(cell);
    std::string thesis = "-";
    if (const auto level = study.thesis.find(cell.level); level != study.thesis.end()) {
      if (const auto rate = level->second.find(cell.controller); rate != level->second.end()) {
        thesis = fmt::format("{:.2f}", rate->second);
      }
    }
    const auto with_interval = [&](auto value, int digits) {
      const Mean mean = mean_of(cell.successes, value);
      return fmt::format("{:.{}f} ± {:.{}f}", mean.value, digits, mean.half_width, digits);
    };
    text += fmt::format("{:<8}{:<12}{:<10}{:<16}{:<9}{:<16}{:<18}{:<16}{}\n", cell.level, cell.controller,
                        fmt::format("{}/{}", share.successes, share.runs),
                        fmt::format("{:.2f} to {:.2f}", share.low, share.high), thesis,
                        with_interval(replans, 1), with_interval(cost, 0),
                        with_interval(plan_seconds, 1), with_interval(seconds, 1));
  }
  text += "\nRe-plans, cost and times: mean of the successful runs and 95 % interval of the mean;\n"
          "one thread per run. The world stands still while its planner thinks.\n";
  return text;
}

std::string study_json(const GraspingStudy& study, const std::vector<GraspingRun>& runs) {
  nlohmann::json json{{"title", study.title}, {"objects", study.objects}};
  for (const Cell& cell : cells(study, runs)) {
    const Share share = share_of(cell);
    json["rows"].push_back({{"level", cell.level},
                            {"controller", cell.controller},
                            {"successes", share.successes},
                            {"runs", share.runs},
                            {"interval", {share.low, share.high}},
                            {"replans", mean_of(cell.successes, replans).value},
                            {"execution_cost", mean_of(cell.successes, cost).value},
                            {"plan_seconds", mean_of(cell.successes, plan_seconds).value},
                            {"total_seconds", mean_of(cell.successes, seconds).value}});
  }
  for (const GraspingRun& run : runs) {
    const planners::Outcome& outcome = run.outcome;
    json["runs"].push_back(
        {{"seed", run.seed},
         {"level", run.level},
         {"controller", run.controller},
         {"success", outcome.success},
         {"reason", run.error.empty() ? outcome.reason : run.error},
         {"plan_hash", to_string(hash_of(outcome.first_plan.controls.values))},
         {"plan_seconds", outcome.plan_time.count()},
         {"total_seconds", outcome.total_time.count()},
         {"replans", outcome.replans},
         {"actions", outcome.actions},
         {"rollouts", outcome.rollouts},
         {"execution_cost", run.execution_cost}});
  }
  return json.dump(1) + "\n";
}

}  // namespace jostle::services
