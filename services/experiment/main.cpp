// jostle experiment: the thesis's studies, run again.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>
#include <thread>

#include "services/experiment/grasping_study.hpp"
#include "services/support/files.hpp"
#include "services/support/program.hpp"

namespace {

using namespace jostle;
using namespace jostle::services;

// Studies are the files of experiments/ that have a title; the others are parameters.
int list_studies() {
  std::vector<std::string> names;
  std::error_code problem;
  for (const auto& entry : std::filesystem::directory_iterator(data_file("experiments"), problem)) {
    if (entry.path().extension() == ".yaml") names.push_back(entry.path().stem().string());
  }
  std::ranges::sort(names);
  for (const std::string& name : names) {
    if (auto study_result = load_grasping_study(name)) fmt::print("{:<12} {}\n", name, study_result->title);
  }
  return 0;
}

// "1-10" or "7".
bool parse_seeds(const std::string& text, GraspingStudy& study) {
  unsigned long long first = 0, last = 0;
  char rest = 0;
  const int found = std::sscanf(text.c_str(), "%llu-%llu%c", &first, &last, &rest);
  if (found == 1) last = first;
  if ((found != 1 && found != 2) || last < first) return false;
  study.first_seed = first;
  study.last_seed = last;
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Runs one of the thesis's studies and prints its table.", "jostle experiment");
  std::string name, seeds, json;
  std::vector<std::string> levels, controllers;
  std::optional<double> timeout;
  int jobs = static_cast<int>(std::max(std::thread::hardware_concurrency(), 1u));
  app.add_option("name", name, "A study, or `list`")->required();
  app.add_option("--seeds", seeds, "Scenes, such as 1-10 (default: the study's)");
  app.add_option("--levels", levels, "Uncertainty levels, such as none,medium")->delimiter(',');
  app.add_option("--controllers", controllers, "Controllers, such as or,nr")->delimiter(',');
  app.add_option("--jobs", jobs, "Runs at a time")->capture_default_str()->check(CLI::Range(1, 1024));
  app.add_option("--timeout", timeout, "Of one run, s (default: the parameters')")->check(CLI::Range(1.0, 1e6));
  app.add_option("--json", json, "File for all numbers");
  if (const auto code = parse_arguments(app, argc, argv)) return *code;

  if (name == "list") return list_studies();
  auto study_result = load_grasping_study(name);
  if (!study_result) {
    fmt::print(stderr, "{}\n", study_result.error().message);
    return study_result.error().code == Code::kNotFound ? 2 : 1;
  }
  GraspingStudy& study = *study_result;
  if (!seeds.empty() && !parse_seeds(seeds, study)) {
    fmt::print(stderr, "--seeds: got '{}', wanted a number or a range such as 1-10\n", seeds);
    return 2;
  }
  if (timeout) study.parameters.control.timeout = std::chrono::milliseconds(std::llround(*timeout * 1e3));
  if (!levels.empty()) study.levels = levels;
  if (!controllers.empty()) study.controllers = controllers;
  for (const std::string& level : study.levels) {
    if (auto ok = physics_pool::parse_uncertainty(level); !ok) {
      fmt::print(stderr, "--levels: {}\n", ok.error().message);
      return 2;
    }
  }

  const auto total = study.levels.size() * study.controllers.size() *
                     (study.last_seed - study.first_seed + 1);
  std::size_t done = 0;
  bool broken = false;
  const auto runs = run_study(study, jobs, [&](const GraspingRun& run) {
    ++done;
    broken = broken || !run.error.empty();
    fmt::print(stderr, "[{:>3}/{}] {:<7} {} seed {:<4} {:<7} {} ({:.0f} s, {} re-plans)\n", done, total,
               run.level, run.controller, run.seed, run.outcome.success ? "ok" : "FAILED",
               run.error.empty() ? run.outcome.reason : run.error, run.outcome.total_time.count(),
               run.outcome.replans);
  });
  fmt::print("{}", study_table(study, runs));
  if (!json.empty()) {
    if (auto ok = write_text(json, study_json(study, runs)); !ok) {
      fmt::print(stderr, "{}\n", ok.error().message);
      return 1;
    }
  }
  return broken ? 1 : 0;
}
