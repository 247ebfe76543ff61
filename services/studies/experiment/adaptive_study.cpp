#include "services/studies/experiment/adaptive_study.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <optional>

#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/scenarios/chapter5.hpp"
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

// "tampc", or "tampc:0.075": a controller, and the b that its planner believes in, whatever the world's.
struct Method {
  std::string controller;
  std::optional<double> believed;
};

Result<Method> parse_method(const std::string& text, const std::string& where) {
  const auto colon = text.find(':');
  Method method{.controller = text.substr(0, colon)};
  if (auto ok = check_methods({method.controller}, where); !ok) return ok.error();
  if (colon == text.npos) return method;
  const std::string number = text.substr(colon + 1);
  double believed = 0.0;
  const auto [end, error] = std::from_chars(number.data(), number.data() + number.size(), believed);
  if (error != std::errc() || end != number.data() + number.size() || !(believed >= 0 && believed <= 1))
    return invalid(where, "'" + text + "'", "a number from 0 to 1 after the colon, such as tampc:0.075");
  method.believed = believed;
  return method;
}

// One scene, one method, one level.
struct Case {
  std::string task, method;
  double level = 0.0;
  std::uint64_t seed = 0;

  std::string name() const { return fmt::format("{} b {} {} seed {}", task, level, method, seed); }
};

json record_of(const Case& one, const planners::Outcome& outcome) {
  return {{"seed", one.seed},
          {"task", one.task},
          {"method", one.method},
          {"level", one.level},
          {"success", outcome.success},
          {"ending", planners::to_string(outcome.ending)},
          {"reason", outcome.reason},
          {"actions", outcome.actions},
          {"rollouts", outcome.rollouts},
          {"planning_seconds", outcome.planning_time.count()}};
}

json record_of(const Case& one, const std::string& error) {
  json record = record_of(one, planners::Outcome{.ending = Ending::kBroken, .reason = error});
  for (const char* key : {"actions", "rollouts", "planning_seconds"}) record[key] = nullptr;
  return record;
}

// Each action with where the target was before it and what was considered.
void note(const planners::ControlEvent& event, const physics_pool::TaskGeometry& geometry, json& way) {
  if (event.phase != planners::Phase::kActing || !event.plan || event.plan->chosen < 0) return;
  const planners::Plan& plan = *event.plan;
  const double* p = geometry.view(*event.observed).target().position();
  json considered = json::array();
  for (const planners::Choice& choice : plan.choices) {
    considered.push_back({{"actions", choice.actions},
                          {"speed", choice.speed},
                          {"value", common::number_or_null(choice.value)},
                          {"spread", common::number_or_null(choice.spread)}});
  }
  way.push_back({{"x", p[0]},
                 {"y", p[1]},
                 {"speed", plan.choices[static_cast<std::size_t>(plan.chosen)].speed},
                 {"chosen", plan.chosen},
                 {"considered", std::move(considered)}});
}

Result<json> perform(const AdaptiveStudy& study, const Case& one, std::optional<double> believed,
                     std::stop_token stop) {
  const auto task = physics_pool::parse_adaptive_task(one.task);
  auto scene_result = physics_pool::generate_chapter5({.task = *task, .seed = one.seed});
  if (!scene_result) return scene_result.error();
  auto truth_result = physics_pool::World::compile(*scene_result);
  if (!truth_result) return truth_result.error();
  physics_pool::ThreadPool pool(1);
  task::Parameters parameters = study.parameters;
  const auto method_result = parse_method(one.method, "method");
  if (!method_result) return method_result.error();
  parameters.controller.adaptive.noise = method_result->believed.value_or(believed.value_or(one.level));
  auto run_result = task::Composition::make({.belief = *scene_result,
                                             .belief_is_exact = true,
                                             .parameters = std::move(parameters),
                                             .controller = method_result->controller,
                                             .seed = one.seed},
                                            pool);
  if (!run_result) return run_result.error();
  physics_pool::ExecutionWorld world(*truth_result, {.slope = one.level, .seed = one.seed});
  world::SimulatedRobot robot(world);
  world::SimulatedObjects objects(world, *scene_result);
  json way = json::array();
  auto outcome_result = run_result->perform(
      robot, objects,
      {.on_event = [&](const planners::ControlEvent& event) { note(event, run_result->geometry(), way); }}, stop);
  if (!outcome_result) return outcome_result.error();
  json record = record_of(one, *outcome_result);
  record["way"] = std::move(way);
  return record;
}

double rollouts(const json& run) { return run["rollouts"]; }

// Runs of one task at one level with one method.
struct Cell : RunGroup {
  Case what;
};

class AdaptiveStudyRunner final : public Study {
 public:
  explicit AdaptiveStudyRunner(AdaptiveStudy study) : Study(study.about), study_(std::move(study)) {}

  void add_options(CLI::App& app) override {
    seeds_.add_to(app, study_.first_seed, study_.last_seed);
    app.add_option("--tasks", study_.tasks, "Only these, such as wide,strip")
        ->delimiter(',')
        ->check(CLI::IsMember({"wide", "strip", "changing", "l", "clutter"}));
    app.add_option("--methods", study_.methods,
                   "Only these, such as tampc,uampc; tampc:0.075 has a planner that believes in b = 0.075")
        ->delimiter(',');
    app.add_option("--levels", study_.levels, "Slopes b of the noise (Eq. 5.10), such as 0,0.1")
        ->delimiter(',')
        ->check(CLI::Range(0.0, 1.0));
    app.add_option("--believed", believed_, "The slope that the planner believes in (default: the world's)")
        ->check(CLI::Range(0.0, 1.0));
    app.add_option("--set", changes_, "One parameter, such as adaptive.samples=16; may be given again")
        ->type_name("KEY=VALUE")
        ->allow_extra_args(false);
    add_jobs_option(app, jobs_, "Runs at a time; more than there are free cores make times longer");
  }

  Result<std::vector<std::string>> prepare() override {
    if (auto ok = seeds_.apply(study_.first_seed, study_.last_seed); !ok) return ok.error();
    for (const std::string& method : study_.methods) {
      if (auto ok = parse_method(method, "--methods"); !ok) return ok.error();
    }
    auto parameters_result = task::with_settings(study_.parameters, changes_);
    if (!parameters_result) return parameters_result.error();
    study_.parameters = std::move(parameters_result).value();
    std::vector<std::string> names;
    cases_.clear();
    for (std::uint64_t seed = study_.first_seed; seed <= study_.last_seed; ++seed) {
      for (const std::string& task : study_.tasks) {
        for (const double level : study_.levels) {
          for (const std::string& method : study_.methods) {
            cases_.push_back({.task = task, .method = method, .level = level, .seed = seed});
            names.push_back(cases_.back().name());
          }
        }
      }
    }
    return names;
  }

  json settings() const override { return {{"believed", believed_ ? json(*believed_) : json()}, {"set", changes_}}; }

  int at_a_time() const override { return jobs_; }

  Result<json> run_case(std::size_t index, std::stop_token stop) override {
    return perform(study_, cases_[index], believed_, std::move(stop));
  }

  std::string news_of(const json& run) const override {
    return fmt::format("{}, {} ({} actions, {} rollouts, {:.1f} s of planning)", run["ending"].get<std::string>(),
                       run["reason"].get<std::string>(), run["actions"].get<int>(), run["rollouts"].get<int>(),
                       planning(run));
  }

  StudyReport report(const std::vector<json>& records) const override {
    json runs =
        runs_of(records, [this](std::size_t i, const std::string& error) { return record_of(cases_[i], error); });
    const std::vector<Cell> all = cells(runs);
    json rows = json::array();
    for (const Cell& cell : all) rows.push_back(row_of(cell));
    return {.table = table_of(all),
            .json = {{"title", title()},
                     {"seconds_per_action", seconds_per_action()},
                     {"settings", settings()},
                     {"rows", std::move(rows)},
                     {"runs", std::move(runs)}}};
  }

  bool has_figure() const override { return true; }

  std::vector<common::Panel> figure(const json& report) const override {
    return study_.shows_ways ? ways(report.at("runs")) : success_and_time(report.at("runs"));
  }

 private:
  double seconds_per_action() const {
    return study_.parameters.planner.step_duration + study_.parameters.controller.adaptive.rest;
  }

  common::Mean total(const Cell& cell) const {
    const double each = seconds_per_action();
    return mean_over(cell.runs, [each](const json& run) { return planning(run) + each * actions(run); });
  }

  std::vector<Cell> cells(const json& runs) const {
    std::vector<Cell> result;
    for (const std::string& task : study_.tasks) {
      for (const double level : study_.levels) {
        for (const std::string& method : study_.methods) {
          result.emplace_back().what = {.task = task, .method = method, .level = level};
          for (const json& run : runs) {
            if (run["task"] == task && run["level"] == level && run["method"] == method) result.back().add(run);
          }
        }
      }
    }
    return result;
  }

  std::string thesis_of(const Case& one) const {
    const auto task = study_.thesis.find(one.task);
    if (task == study_.thesis.end()) return "-";
    const auto method = task->second.find(one.method);
    return method == task->second.end() ? "-" : method->second;
  }

  std::string table_of(const std::vector<Cell>& all) const {
    std::vector<std::vector<std::string>> ends{{"task", "b", "method", "success", "95 % interval", "thesis"}};
    std::vector<std::vector<std::string>> costs{
        {"task", "b", "method", "actions", "rollouts", "planning, s", "total, s"}};
    int broken = 0;
    for (const Cell& cell : all) {
      const common::Share share = cell.share();
      broken += cell.broken;
      const std::string level = fmt::format("{}", cell.what.level);
      ends.push_back({cell.what.task, level, cell.what.method, fmt::format("{}/{}", share.successes, share.runs),
                      common::interval_text(share.low, share.high), thesis_of(cell.what)});
      costs.push_back({cell.what.task, level, cell.what.method, to_text(mean_over(cell.runs, actions), 1),
                       to_text(mean_over(cell.runs, rollouts), 0), to_text(mean_over(cell.runs, planning), 1),
                       to_text(total(cell), 1)});
    }
    std::string text = fmt::format("{}\n\n{}\n{}", title(), common::table(ends), common::table(costs));
    text += fmt::format(
        "\nMeans over all runs, with what those that failed have spent, and 95 % intervals of the mean. An\n"
        "action and its rest take {} s; total is that for each action, and planning, for whose time the\n"
        "world stands still.\n",
        seconds_per_action());
    if (broken > 0) text += fmt::format("Parts of the system failed in {} more runs, which count nowhere.\n", broken);
    if (!study_.remark.empty()) text += study_.remark + "\n";
    return text;
  }

  json row_of(const Cell& cell) const {
    json row{{"task", cell.what.task},
             {"level", cell.what.level},
             {"method", cell.what.method},
             {"thesis", thesis_of(cell.what)}};
    put_share(row, cell);
    const std::pair<const char*, common::Mean> means[] = {{"actions", mean_over(cell.runs, actions)},
                                                          {"rollouts", mean_over(cell.runs, rollouts)},
                                                          {"planning_seconds", mean_over(cell.runs, planning)},
                                                          {"total_seconds", total(cell)}};
    for (const auto& [key, mean] : means) put_mean(row, key, mean);
    return row;
  }

  // Fig. 5.3: a and b, success; c and d, time.
  std::vector<common::Panel> success_and_time(const json& runs) const {
    const std::vector<Cell> all = cells(runs);
    std::vector<common::Panel> panels;
    for (const bool is_time : {false, true}) {
      for (const std::string& task : study_.tasks) {
        common::Panel panel{.x_label = task + ": b", .y_label = is_time ? "total time, s" : "success"};
        for (const std::string& method : study_.methods) {
          common::Band band{.name = method};
          for (const Cell& cell : all) {
            if (cell.what.task != task || cell.what.method != method || cell.runs.empty()) continue;
            const common::Share share = cell.share();
            const common::Mean mean = total(cell);
            band.x.push_back(cell.what.level);
            band.low.push_back(is_time ? mean.value - mean.half_width : share.low);
            band.high.push_back(is_time ? mean.value + mean.half_width : share.high);
            band.middle.push_back(is_time ? mean.value : double(share.successes) / share.runs);
          }
          if (!band.x.empty()) panel.bands.push_back(std::move(band));
        }
        if (!panel.bands.empty()) panels.push_back(std::move(panel));
      }
    }
    return panels;
  }

  // Fig. 5.4: the speed that was chosen where the target was, with the first method at the first level.
  std::vector<common::Panel> ways(const json& runs) const {
    std::vector<common::Panel> panels;
    for (const std::string& task : study_.tasks) {
      common::Panel panel{.x_label = task + ": action", .y_label = "speed, m/s", .counts_x = true};
      for (const json& run : runs) {
        if (run["task"] != task || run["level"] != study_.levels.front() || run["method"] != study_.methods.front() ||
            !run.contains("way"))
          continue;
        common::Band band{.name = fmt::format("seed {}", run["seed"].get<std::uint64_t>())};
        for (const json& action : run["way"]) {
          band.x.push_back(static_cast<double>(band.x.size()) + 1);
          band.middle.push_back(action["speed"]);
          band.low.push_back(common::kNone);
          band.high.push_back(common::kNone);
        }
        if (!band.x.empty()) panel.bands.push_back(std::move(band));
      }
      if (!panel.bands.empty()) panels.push_back(std::move(panel));
    }
    return panels;
  }

  AdaptiveStudy study_;
  SeedsOption seeds_;
  std::optional<double> believed_;
  std::vector<std::string> changes_;
  int jobs_ = 1;
  std::vector<Case> cases_;
};

Result<void> check(const AdaptiveStudy& study, const std::string& origin) {
  for (const std::string& task : study.tasks) {
    if (!physics_pool::parse_adaptive_task(task))
      return invalid(origin + ": tasks", "'" + task + "'", "wide, strip, changing, l or clutter");
  }
  for (const std::string& method : study.methods) {
    if (auto ok = parse_method(method, origin + ": methods"); !ok) return ok.error();
  }
  for (const double level : study.levels) {
    if (!(level >= 0 && level <= 1)) return invalid(origin + ": levels", fmt::format("{}", level), "0 to 1");
  }
  if (study.tasks.empty() || study.methods.empty() || study.levels.empty())
    return invalid(origin + ": tasks, methods, levels", "an empty list", "at least one of each");
  return {};
}

}  // namespace

Result<std::unique_ptr<Study>> read_adaptive_study(yaml::Fields& fields, const std::string& origin) {
  AdaptiveStudy study{.about = read_about(fields)};
  std::string parameters;
  fields.required("parameters", parameters);
  fields.required("tasks", study.tasks);
  fields.required("methods", study.methods);
  fields.required("levels", study.levels);
  read_seeds(fields, study.first_seed, study.last_seed);
  fields.choice<bool>("figure", study.shows_ways, {{"success", false}, {"ways", true}});
  fields.optional("thesis", study.thesis);
  fields.optional("remark", study.remark);
  if (auto ok = check(study, origin); !ok) return ok.error();
  auto parameters_result = parameters_beside(origin, parameters);
  if (!parameters_result) return parameters_result.error();
  study.parameters = *parameters_result;
  // No clock decides: actions and rollouts are what is limited.
  study.parameters.limits.timeout = std::chrono::hours(24);
  return std::unique_ptr<Study>(std::make_unique<AdaptiveStudyRunner>(std::move(study)));
}

}  // namespace jostle::studies
