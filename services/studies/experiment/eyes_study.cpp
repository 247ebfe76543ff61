#include "services/studies/experiment/eyes_study.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <filesystem>
#include <optional>

#include "physics_pool/scenarios/chapter3.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/child_process.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/temporary_folder.hpp"
#include "services/common/results/results.hpp"
#include "services/common/results/table.hpp"
#include "services/studies/experiment/options.hpp"
#include "services/studies/experiment/runs.hpp"

namespace jostle::studies {
namespace {

using nlohmann::json;
using planners::Ending;

constexpr auto kTick = std::chrono::milliseconds(200);
constexpr double kTimeout = 300;      // s, of a run's planning and execution
constexpr double kStartAndEnd = 120;  // s, beside that

// Removed at the end.
struct Folder {
  std::filesystem::path path;
  ~Folder() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
};

struct Case {
  std::string sensor;
  std::uint64_t seed = 0;
};

json record_of(const Case& one, const json& run) {
  json record{{"seed", one.seed}, {"sensor", one.sensor}};
  for (const char* key : {"success", "ending", "reason", "plan_seconds", "total_seconds", "actions", "replans"})
    record[key] = run.at(key);
  return record;
}

json broken_record_of(const Case& one, const std::string& error) {
  return {{"seed", one.seed},
          {"sensor", one.sensor},
          {"success", false},
          {"ending", planners::to_string(Ending::kBroken)},
          {"reason", error}};
}

// Runs that came to an end, whatever it was, with one sensor.
struct Cell {
  std::string sensor;
  int runs = 0, broken = 0;
  std::vector<const json*> successes;

  void add(const json& run) {
    if (ended_as(run, Ending::kBroken)) {
      ++broken;
      return;
    }
    ++runs;
    if (run["success"]) successes.push_back(&run);
  }
  common::Share share() const { return common::wilson_interval(static_cast<int>(successes.size()), runs); }
  common::Mean mean(const char* key) const {
    return mean_over(successes, [key](const json& run) { return run[key].get<double>(); });
  }
};

class EyesStudyRunner final : public Study {
 public:
  explicit EyesStudyRunner(EyesStudy study) : Study(study.about), study_(std::move(study)) {}

  void add_options(CLI::App& app) override {
    seeds_.add_to(app, study_.first_seed, study_.last_seed);
    app.add_option("--arm", study_.arm, "sim or ur-sim, as of `jostle run`")
        ->capture_default_str()
        ->check(CLI::IsMember({"sim", "ur-sim"}));
    app.add_option("--sensors", study_.sensors, "sim, mocap-sim, camera-sim, as --objects of `jostle run`")
        ->delimiter(',')
        ->capture_default_str()
        ->check(CLI::IsMember({"sim", "mocap-sim", "camera-sim"}));
    add_timeout_option(app, timeout_);
  }

  Result<std::vector<std::string>> prepare() override {
    if (auto ok = seeds_.apply(study_.first_seed, study_.last_seed); !ok) return ok.error();
    cases_.clear();
    std::vector<std::string> names;
    for (std::uint64_t seed = study_.first_seed; seed <= study_.last_seed; ++seed) {
      for (const std::string& sensor : study_.sensors) {
        cases_.push_back({sensor, seed});
        names.push_back(fmt::format("arm {}, objects {}, seed {}", study_.arm, sensor, seed));
      }
    }
    return names;
  }

  json settings() const override { return {{"timeout_s", timeout_.value_or(kTimeout)}}; }

  Result<json> run_case(std::size_t index, std::stop_token stop) override {
    const Case& one = cases_[index];
    const auto scene_result = physics_pool::generate_chapter3({.objects = study_.objects, .seed = one.seed});
    if (!scene_result) return scene_result.error();
    const auto folder_result = common::make_temporary_folder("eyes");
    if (!folder_result) return folder_result.error();
    const Folder folder{*folder_result};
    const auto scene = folder.path / "scene.yaml", report = folder.path / "run.json";
    if (auto ok = common::write_text(scene, physics_pool::to_yaml(*scene_result)); !ok) return ok.error();
    const double timeout = timeout_.value_or(kTimeout);
    auto run_result = common::ChildProcess::start(
        common::program_folder() / "jostle_run",
        {scene, "--arm", study_.arm, "--objects", one.sensor, "--seed", std::to_string(one.seed), "--timeout",
         fmt::format("{}", timeout), "--workers", "1", "--headless", "--json", report},
        folder.path / "log");
    if (!run_result) return run_result.error();
    common::ChildProcess& run = *run_result;
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout + kStartAndEnd);
    std::optional<common::ExitStatus> ended;
    while (!(ended = run.wait_for(kTick))) {
      if (stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
      if (std::chrono::steady_clock::now() > deadline)
        return Error{Code::kDeadline,
                     fmt::format("jostle run: no end in {:g} s\n{}", timeout + kStartAndEnd, run.last_words())};
    }
    const auto text_result = common::read_text(report);
    if (!text_result)
      return Error{Code::kUnavailable, fmt::format("jostle run: {}\n{}", ended->text(), run.last_words())};
    const json outcome = json::parse(*text_result, nullptr, false);
    if (outcome.is_discarded() || ended_as(outcome, Ending::kBroken))
      return Error{Code::kUnavailable,
                   fmt::format("jostle run: {}",
                               outcome.is_discarded() ? run.last_words() : outcome["reason"].get<std::string>())};
    return record_of(one, outcome);
  }

  std::string news_of(const json& run) const override {
    return fmt::format("{}, {} ({:.0f} s)", run["ending"].get<std::string>(), run["reason"].get<std::string>(),
                       run["total_seconds"].get<double>());
  }

  StudyReport report(const std::vector<json>& records) const override {
    const std::vector<json> runs = runs_of(
        records, [this](std::size_t i, const std::string& error) { return broken_record_of(cases_[i], error); });
    std::vector<std::vector<std::string>> rows{
        {"objects", "success", "95 % interval", "actions", "re-plans", "first plan, s", "total, s", "broken"}};
    json result{{"title", title()}, {"objects", study_.objects}, {"arm", study_.arm}, {"rows", json::array()}};
    for (const std::string& sensor : study_.sensors) {
      Cell cell{.sensor = sensor};
      for (const json& run : runs) {
        if (run["sensor"] == sensor) cell.add(run);
      }
      const common::Share share = cell.share();
      rows.push_back({sensor, fmt::format("{}/{}", share.successes, share.runs),
                      common::interval_text(share.low, share.high), to_text(cell.mean("actions"), 1),
                      to_text(cell.mean("replans"), 1), to_text(cell.mean("plan_seconds"), 1),
                      to_text(cell.mean("total_seconds"), 1), std::to_string(cell.broken)});
      json row{{"sensor", sensor},
               {"successes", share.successes},
               {"runs", share.runs},
               {"broken", cell.broken},
               {"interval", {common::number_or_null(share.low), common::number_or_null(share.high)}}};
      for (const char* key : {"actions", "replans", "plan_seconds", "total_seconds"})
        put_mean(row, key, cell.mean(key));
      result["rows"].push_back(std::move(row));
    }
    result["runs"] = runs;
    return {.table = fmt::format("{}\n\n{}\nActions, re-plans and times: mean of the successful runs, and its 95 % "
                                 "interval. Runs in which a part\nof the system failed are broken, and count nowhere "
                                 "else.\n",
                                 title(), common::table(rows)),
            .json = std::move(result)};
  }

 private:
  EyesStudy study_;
  SeedsOption seeds_;
  std::optional<double> timeout_;  // s
  std::vector<Case> cases_;
};

}  // namespace

Result<std::unique_ptr<Study>> read_eyes_study(yaml::Fields& fields, const std::string&) {
  EyesStudy study{.about = read_about(fields)};
  fields.optional("objects", study.objects);
  fields.section("seeds", true, [&](yaml::Fields& seeds) {
    seeds.required("first", study.first_seed);
    seeds.required("last", study.last_seed);
  });
  fields.optional("arm", study.arm);
  fields.required("sensors", study.sensors);
  return std::unique_ptr<Study>(std::make_unique<EyesStudyRunner>(std::move(study)));
}

}  // namespace jostle::studies
