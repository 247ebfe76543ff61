#include "services/studies/experiment/push_study.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <mutex>
#include <tuple>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/scenarios/push.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/task/config/predictor.hpp"
#include "services/task/session/composition.hpp"
#include "services/world/in_process/in_process_world.hpp"

namespace jostle::studies {
namespace {

using physics_pool::Scene;
using physics_pool::Uncertainty;

Result<Scene> scene_of(const PushStudy& study, std::uint64_t seed) {
  const physics_pool::GeneratePushOptions options{.seed = seed, .shape = study.shape, .objects = study.objects};
  return study.chapter == 6 ? physics_pool::generate_chapter6(options) : physics_pool::generate_chapter7(options);
}

Result<planners::Outcome> push(const PushStudy& study, const PushRun& run, std::stop_token stop) {
  auto scene_result = scene_of(study, run.seed);
  if (!scene_result) return scene_result.error();
  const Scene& scene = *scene_result;
  const Scene belief = physics_pool::perturb(scene, study.reality, run.seed);
  auto truth_result = physics_pool::World::compile(scene);
  if (!truth_result) return truth_result.error();
  const PushStudy::Entry& entry = study.entries[run.entry];
  physics_pool::ThreadPool threads(entry.threads);
  auto predictor_result = task::Predictor::make(entry.predictor, threads);
  if (!predictor_result) return predictor_result.error();
  auto run_result = task::Composition::make({.belief = belief,
                                             .belief_is_exact = study.reality == Uncertainty::kNone,
                                             .parameters = study.parameters,
                                             .seed = run.seed},
                                            predictor_result->pool());
  if (!run_result) return run_result.error();
  physics_pool::ExecutionWorld world(*truth_result,
                                     {.sigma = physics_pool::velocity_noise(study.reality), .seed = run.seed});
  world::SimulatedRobot robot(world);
  world::SimulatedObjects objects(world, belief);
  return run_result->perform(robot, objects, {}, stop);
}

// Runs with one predictor.
struct Cell {
  PushStudy::Entry entry;
  std::vector<const PushRun*> runs, successes;

  template <class Value>
  common::Mean over_runs(Value value) const {
    std::vector<double> values;
    for (const PushRun* run : runs) values.push_back(value(*run));
    return common::mean_of(values);
  }
};

std::vector<Cell> cells(const PushStudy& study, const std::vector<PushRun>& runs) {
  std::vector<Cell> result;
  for (const PushStudy::Entry& entry : study.entries) result.push_back({.entry = entry});
  for (const PushRun& run : runs) {
    result[run.entry].runs.push_back(&run);
    if (run.outcome.success) result[run.entry].successes.push_back(&run);
  }
  return result;
}

planners::Ending ending_of(const PushRun& run) {
  return run.error.empty() ? run.outcome.ending : planners::Ending::kBroken;
}
double planning(const PushRun& run) { return run.outcome.planning_time.count(); }
double actions(const PushRun& run) { return run.outcome.actions; }
double per_plan(const PushRun& run) { return planning(run) / std::max(run.outcome.replans + 1, 1); }

StudyReport report(const PushStudy& study, const std::vector<PushRun>& runs) {
  StudyReport result;
  result.table = fmt::format("{}\n\n{:<28}{:<9}{:<10}{:<16}{:<14}{:<18}{:<18}{}\n", study.title, "predictor", "threads",
                             "success", "95 % interval", "actions", "planning, s", "per plan, s", "completion, s");
  result.json = {{"title", study.title}, {"rows", nlohmann::json::array()}, {"runs", nlohmann::json::array()}};
  common::Panel panel{.x_label = "predictors, in the legend's order", .y_label = "task completion, s"};
  const auto text = [](const common::Mean& mean, int digits) {
    return fmt::format("{:.{}f} ± {:.{}f}", mean.value, digits, mean.half_width, digits);
  };
  const double step = study.parameters.controller.mpc.step_duration;
  const auto completion = [step](const PushRun& run) { return planning(run) + step * actions(run); };
  for (const Cell& cell : cells(study, runs)) {
    const common::Share share =
        common::wilson_interval(static_cast<int>(cell.successes.size()), static_cast<int>(cell.runs.size()));
    const common::Mean taken = cell.over_runs(actions), planned = cell.over_runs(planning),
                       each = cell.over_runs(per_plan);
    const common::Mean whole = cell.over_runs(completion);
    result.table += fmt::format("{:<28}{:<9}{:<10}{:<16}{:<14}{:<18}{:<18}{}\n", cell.entry.predictor,
                                cell.entry.threads, fmt::format("{}/{}", share.successes, share.runs),
                                fmt::format("{:.2f} to {:.2f}", share.low, share.high), text(taken, 1),
                                text(planned, 2), text(each, 3), text(whole, 1));
    result.json["rows"].push_back({{"predictor", cell.entry.predictor},
                                   {"threads", cell.entry.threads},
                                   {"successes", share.successes},
                                   {"runs", share.runs},
                                   {"interval", {share.low, share.high}},
                                   {"actions", taken.value},
                                   {"planning_seconds", planned.value},
                                   {"planning_seconds_half_width", planned.half_width},
                                   {"seconds_per_plan", each.value},
                                   {"seconds_per_plan_half_width", each.half_width},
                                   {"completion_seconds", whole.value}});
    // A level each: predictors have an order in the legend, not on an axis.
    const auto place = static_cast<double>(panel.bands.size());
    const double low = whole.value - whole.half_width, high = whole.value + whole.half_width;
    panel.bands.push_back({.name = fmt::format("{} x{}", cell.entry.predictor, cell.entry.threads),
                           .x = {place + 0.1, place + 0.9},
                           .low = {low, low},
                           .middle = {whole.value, whole.value},
                           .high = {high, high}});
  }
  result.table +=
      "\nMeans over all runs, failed ones too, with 95 % intervals of the mean. Completion: planning, and an\n"
      "action's duration for each action. The world stands still while its planner thinks.\n";
  if (!study.remark.empty()) result.table += study.remark + "\n";
  result.panels = {panel};
  for (const PushRun& run : runs) {
    result.broken = result.broken || !run.error.empty();
    result.json["runs"].push_back({{"seed", run.seed},
                                   {"predictor", study.entries[run.entry].predictor},
                                   {"threads", study.entries[run.entry].threads},
                                   {"success", run.outcome.success},
                                   {"ending", planners::to_string(ending_of(run))},
                                   {"reason", run.error.empty() ? run.outcome.reason : run.error},
                                   {"actions", run.outcome.actions},
                                   {"rollouts", run.outcome.rollouts},
                                   {"planning_seconds", planning(run)}});
  }
  return result;
}

class PushStudyRunner final : public Study {
 public:
  explicit PushStudyRunner(PushStudy study) : study_(std::move(study)) {}

  const std::string& title() const override { return study_.title; }

  Result<StudyReport> run(const StudyOptions& options) override {
    if (!options.levels.empty() || !options.controllers.empty() || options.samples || !options.models.empty()) {
      return Error{Code::kInvalidArgument,
                   "this study has no --levels, --controllers, --samples or --models, wanted "
                   "--seeds, --timeout"};
    }
    PushStudy study = study_;
    if (options.seeds) std::tie(study.first_seed, study.last_seed) = *options.seeds;
    if (options.timeout) study.parameters.limits.timeout = *options.timeout;
    const std::size_t total = study.entries.size() * (study.last_seed - study.first_seed + 1);
    std::size_t done = 0;
    const auto runs = run_study(study, options, [&](const PushRun& run) {
      options.on_progress(fmt::format(
          "[{:>3}/{}] seed {:<4} {:<28} x{} {:<7} {} ({} actions, {:.2f} s of planning)", ++done, total, run.seed,
          study.entries[run.entry].predictor, study.entries[run.entry].threads, run.outcome.success ? "ok" : "FAILED",
          run.error.empty() ? run.outcome.reason : run.error, run.outcome.actions, planning(run)));
    });
    if (options.stop.stop_requested()) return Error{Code::kCancelled, "experiment: stopped on request"};
    return report(study, runs);
  }

 private:
  PushStudy study_;
};

}  // namespace

std::vector<PushRun> run_study(const PushStudy& study, const StudyOptions& options,
                               const std::function<void(const PushRun&)>& on_run) {
  std::vector<PushRun> runs;
  for (std::uint64_t seed = study.first_seed; seed <= study.last_seed; ++seed) {
    for (std::size_t entry = 0; entry < study.entries.size(); ++entry) runs.push_back({.seed = seed, .entry = entry});
  }
  std::mutex reporting;
  constexpr int kOneAtATime = 1;  // its threads have the machine to themselves
  run_side_by_side(runs.size(), kOneAtATime, options.stop, [&](std::size_t i) {
    PushRun& run = runs[i];
    auto outcome_result = push(study, run, options.stop);
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

Result<std::unique_ptr<Study>> read_push_study(yaml::Fields& fields, const std::string& origin) {
  using physics_pool::Shape;
  PushStudy study;
  std::string parameters;
  fields.required("title", study.title);
  fields.required("parameters", parameters);
  fields.optional("chapter", study.chapter);
  fields.optional("objects", study.objects);
  fields.optional("remark", study.remark);
  fields.choice<Shape>("shape", study.shape, {{"box", Shape::kBox}, {"cylinder", Shape::kCylinder}});
  fields.choice<Uncertainty>("reality", study.reality,
                             {{"none", Uncertainty::kNone},
                              {"low", Uncertainty::kLow},
                              {"medium", Uncertainty::kMedium},
                              {"high", Uncertainty::kHigh}});
  fields.section("seeds", true, [&](yaml::Fields& seeds) {
    seeds.required("first", study.first_seed);
    seeds.required("last", study.last_seed);
  });
  fields.list("predictors", [&](yaml::Fields& entry) {
    study.entries.emplace_back();
    entry.required("predictor", study.entries.back().predictor);
    entry.optional("threads", study.entries.back().threads);
  });
  if (study.chapter != 6 && study.chapter != 7) {
    return Error{Code::kInvalidArgument, fmt::format("{}: chapter: got {}, wanted 6 or 7", origin, study.chapter)};
  }
  auto parameters_result = task::load_parameters(std::filesystem::path(origin).parent_path() / parameters);
  if (!parameters_result) return parameters_result.error();
  study.parameters = *parameters_result;
  physics_pool::ThreadPool threads(1);
  for (const PushStudy::Entry& entry : study.entries) {
    if (auto ok = task::Predictor::make(entry.predictor, threads); !ok) {
      return Error{ok.error().code, fmt::format("{}: predictors: {}", origin, ok.error().message)};
    }
  }
  return std::unique_ptr<Study>(std::make_unique<PushStudyRunner>(std::move(study)));
}

}  // namespace jostle::studies
