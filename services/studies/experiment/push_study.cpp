#include "services/studies/experiment/push_study.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/scenarios/push.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/results/results.hpp"
#include "services/common/results/table.hpp"
#include "services/studies/experiment/options.hpp"
#include "services/studies/experiment/runs.hpp"
#include "services/task/config/predictor.hpp"
#include "services/task/session/composition.hpp"
#include "services/world/in_process/in_process_world.hpp"

namespace jostle::studies {
namespace {

using nlohmann::json;
using physics_pool::Scene;
using physics_pool::Uncertainty;
using planners::Ending;

// One scene to be pushed in, with one predictor.
struct Case {
  std::uint64_t seed = 0;
  PushStudy::Entry entry;

  std::string name() const { return fmt::format("seed {} {} x{}", seed, entry.predictor, entry.threads); }
};

Result<Scene> scene_of(const PushStudy& study, std::uint64_t seed) {
  const physics_pool::GeneratePushOptions options{.seed = seed, .shape = study.shape, .objects = study.objects};
  return study.chapter == 6 ? physics_pool::generate_chapter6(options) : physics_pool::generate_chapter7(options);
}

Result<planners::Outcome> push(const PushStudy& study, const Case& one, std::stop_token stop) {
  auto scene_result = scene_of(study, one.seed);
  if (!scene_result) return scene_result.error();
  const Scene& scene = *scene_result;
  const Scene belief = physics_pool::perturb(scene, study.reality, one.seed);
  auto truth_result = physics_pool::World::compile(scene);
  if (!truth_result) return truth_result.error();
  physics_pool::ThreadPool threads(one.entry.threads);
  auto predictor_result = task::Predictor::make(one.entry.predictor, threads);
  if (!predictor_result) return predictor_result.error();
  auto run_result = task::Composition::make({.belief = belief,
                                             .belief_is_exact = study.reality == Uncertainty::kNone,
                                             .parameters = study.parameters,
                                             .seed = one.seed},
                                            predictor_result->pool());
  if (!run_result) return run_result.error();
  physics_pool::ExecutionWorld world(*truth_result,
                                     {.sigma = physics_pool::velocity_noise(study.reality), .seed = one.seed});
  world::SimulatedRobot robot(world);
  world::SimulatedObjects objects(world, belief);
  return run_result->perform(robot, objects, {}, stop);
}

json record_of(const Case& one, const planners::Outcome& outcome) {
  return {{"seed", one.seed},
          {"predictor", one.entry.predictor},
          {"threads", one.entry.threads},
          {"success", outcome.success},
          {"ending", planners::to_string(outcome.ending)},
          {"reason", outcome.reason},
          {"actions", outcome.actions},
          {"replans", outcome.replans},
          {"rollouts", outcome.rollouts},
          {"planning_seconds", outcome.planning_time.count()}};
}

json record_of(const Case& one, const std::string& error) {
  json record = record_of(one, planners::Outcome{.ending = Ending::kBroken, .reason = error});
  for (const char* key : {"actions", "replans", "rollouts", "planning_seconds"}) record[key] = nullptr;
  return record;
}

// Runs with one predictor.
struct Cell : RunGroup {
  PushStudy::Entry entry;
  int timed_out = 0;
  std::vector<const json*> in_time;  // of its runs: not ended by the clock

  void add(const json& run) {
    RunGroup::add(run);
    if (ended_as(run, Ending::kTimedOut))
      ++timed_out;
    else if (!ended_as(run, Ending::kBroken))
      in_time.push_back(&run);
  }

  std::string name() const { return fmt::format("{} x{}", entry.predictor, entry.threads); }
};

double per_plan(const json& run) { return planning(run) / (run["replans"].get<double>() + 1); }

std::vector<Cell> cells(const std::vector<PushStudy::Entry>& entries, const json& runs) {
  std::vector<Cell> result;
  for (const PushStudy::Entry& entry : entries) {
    result.emplace_back().entry = entry;
    for (const json& run : runs) {
      if (run["predictor"] == entry.predictor && run["threads"] == entry.threads) result.back().add(run);
    }
  }
  return result;
}

class PushStudyRunner final : public Study {
 public:
  explicit PushStudyRunner(PushStudy study) : Study(study.about), study_(std::move(study)) {}

  void add_options(CLI::App& app) override {
    seeds_.add_to(app, study_.first_seed, study_.last_seed);
    add_timeout_option(app, timeout_);
  }

  Result<std::vector<std::string>> prepare() override {
    if (auto ok = seeds_.apply(study_.first_seed, study_.last_seed); !ok) return ok.error();
    if (timeout_) study_.parameters.limits.timeout = std::chrono::milliseconds(std::llround(*timeout_ * 1e3));
    std::vector<std::string> names;
    cases_.clear();
    for (std::uint64_t seed = study_.first_seed; seed <= study_.last_seed; ++seed) {
      for (const PushStudy::Entry& entry : study_.entries) {
        cases_.push_back({.seed = seed, .entry = entry});
        names.push_back(cases_.back().name());
      }
    }
    return names;
  }

  json settings() const override { return {{"timeout_s", timeout_ ? json(*timeout_) : json()}}; }

  Result<json> run_case(std::size_t index, std::stop_token stop) override {
    auto outcome_result = push(study_, cases_[index], std::move(stop));
    if (!outcome_result) return outcome_result.error();
    return record_of(cases_[index], *outcome_result);
  }

  std::string news_of(const json& run) const override {
    return fmt::format("{}, {} ({} actions, {:.2f} s of planning)", run["ending"].get<std::string>(),
                       run["reason"].get<std::string>(), run["actions"].get<int>(), planning(run));
  }

  StudyReport report(const std::vector<json>& records) const override {
    json runs =
        runs_of(records, [this](std::size_t i, const std::string& error) { return record_of(cases_[i], error); });
    const std::vector<Cell> all = cells(study_.entries, runs);
    json rows = json::array();
    for (const Cell& cell : all) rows.push_back(row_of(cell));
    return {.table = table_of(all), .json = {{"title", title()}, {"rows", std::move(rows)}, {"runs", std::move(runs)}}};
  }

  bool has_figure() const override { return true; }

  std::vector<common::Panel> figure(const json& report) const override {
    common::Panel panel{.y_label = "task completion, s"};
    for (const Cell& cell : cells(study_.entries, report.at("runs"))) {
      const common::Mean mean = completion(cell);
      if (mean.count == 0) continue;
      panel.bands.push_back({.name = cell.name(),
                             .x = {static_cast<double>(panel.names.size())},
                             .low = {mean.value - mean.half_width},
                             .middle = {mean.value},
                             .high = {mean.value + mean.half_width}});
      panel.names.push_back(cell.name());
    }
    if (panel.bands.empty()) return {};
    return {panel};
  }

 private:
  // Planning, and an action's duration for each action. A run that the clock ended would have taken longer.
  common::Mean completion(const Cell& cell) const {
    const double step = study_.parameters.controller.mpc.step_duration;
    return mean_over(cell.in_time, [step](const json& run) { return planning(run) + step * actions(run); });
  }

  std::string table_of(const std::vector<Cell>& all) const {
    std::vector<std::vector<std::string>> ends{
        {"predictor", "threads", "success", "95 % interval", "timed out", "actions"}};
    std::vector<std::vector<std::string>> times{
        {"predictor", "threads", "planning, s", "per plan, s", "completion, s"}};
    int broken = 0;
    for (const Cell& cell : all) {
      const common::Share share = cell.share();
      broken += cell.broken;
      const std::string threads = std::to_string(cell.entry.threads);
      ends.push_back({cell.entry.predictor, threads, fmt::format("{}/{}", share.successes, share.runs),
                      common::interval_text(share.low, share.high), std::to_string(cell.timed_out),
                      to_text(mean_over(cell.runs, actions), 1)});
      times.push_back({cell.entry.predictor, threads, to_text(mean_over(cell.runs, planning), 2),
                       to_text(mean_over(cell.in_time, per_plan), 3), to_text(completion(cell), 1)});
    }
    std::string text = fmt::format("{}\n\n{}\n{}", title(), common::table(ends), common::table(times));
    text +=
        "\nMeans, and 95 % intervals of the mean where there are two runs or more. Actions and planning: over\n"
        "all runs, with what those that failed or timed out have spent. Per plan and completion: over the\n"
        "runs that did not time out. Completion is planning, and an action's duration for each action: the\n"
        "world stands still while its planner thinks.\n";
    if (broken > 0) text += fmt::format("Parts of the system failed in {} more runs, which count nowhere.\n", broken);
    if (!study_.remark.empty()) text += study_.remark + "\n";
    return text;
  }

  json row_of(const Cell& cell) const {
    json row{{"predictor", cell.entry.predictor}, {"threads", cell.entry.threads}, {"timed_out", cell.timed_out}};
    put_share(row, cell);
    const std::pair<const char*, common::Mean> means[] = {{"actions", mean_over(cell.runs, actions)},
                                                          {"planning_seconds", mean_over(cell.runs, planning)},
                                                          {"seconds_per_plan", mean_over(cell.in_time, per_plan)},
                                                          {"completion_seconds", completion(cell)}};
    for (const auto& [key, mean] : means) put_mean(row, key, mean);
    return row;
  }

  PushStudy study_;
  SeedsOption seeds_;
  std::optional<double> timeout_;  // s
  std::vector<Case> cases_;
};

}  // namespace

Result<std::unique_ptr<Study>> read_push_study(yaml::Fields& fields, const std::string& origin) {
  using physics_pool::Shape;
  PushStudy study{.about = read_about(fields)};
  std::string parameters;
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
  read_seeds(fields, study.first_seed, study.last_seed);
  fields.list("predictors", [&](yaml::Fields& entry) {
    study.entries.emplace_back();
    entry.required("predictor", study.entries.back().predictor);
    entry.optional("threads", study.entries.back().threads);
  });
  if (study.chapter != 6 && study.chapter != 7) {
    return Error{Code::kInvalidArgument, fmt::format("{}: chapter: got {}, wanted 6 or 7", origin, study.chapter)};
  }
  auto parameters_result = parameters_beside(origin, parameters);
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
