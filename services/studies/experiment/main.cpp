// jostle experiment: the thesis's studies, run again.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <thread>

#include "planners/controllers/catalogue.hpp"
#include "services/common/process/program.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/experiment/study.hpp"

namespace {

using namespace jostle;
using namespace jostle::studies;

int list() {
  for (const auto& [name, title] : list_studies()) fmt::print("{:<12} {}\n", name, title);
  return common::kExitOk;
}

// "1-10" or "7".
std::optional<std::pair<std::uint64_t, std::uint64_t>> parse_seeds(const std::string& text) {
  unsigned long long first = 0, last = 0;
  char rest = 0;
  const int found = std::sscanf(text.c_str(), "%llu-%llu%c", &first, &last, &rest);
  if (found == 1) last = first;
  if ((found != 1 && found != 2) || last < first) return {};
  return std::pair<std::uint64_t, std::uint64_t>(first, last);
}

int fail(const Error& error) {
  fmt::print(stderr, "{}\n", error.message);
  if (error.code == Code::kCancelled) return common::kExitInterrupted;
  return error.code == Code::kNotFound || error.code == Code::kInvalidArgument ? common::kExitUsage
                                                                               : common::kExitFailed;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Runs one of the thesis's studies and prints its table.", "jostle experiment");
  std::string name, seeds, json, picture;
  std::optional<double> timeout;
  StudyOptions options{.jobs = static_cast<int>(std::max(std::thread::hardware_concurrency(), 1u))};
  app.add_option("name", name, "A study, or `list`")->required();
  app.add_option("--json", json, "File for all numbers");
  app.add_option("--plot", picture, "PNG file for the figure, where the study has one");
  app.add_option("--jobs", options.jobs, "Runs at a time")->capture_default_str()->check(CLI::Range(1, 1024));
  app.add_option("--seeds", seeds, "Scenes, such as 1-10, or the first seed (default: the study's)");
  app.add_option("--samples", options.samples, "Initial states per group (default: the study's)")
      ->check(CLI::Range(1, 100000));
  app.add_option("--models", options.models, "Coarse models or predictors, such as planar,learned")->delimiter(',');
  app.add_option("--levels", options.levels, "Uncertainty levels, such as none,medium")->delimiter(',');
  app.add_option("--controllers", options.controllers, planners::controller_help())->delimiter(',');
  app.add_option("--timeout", timeout, "Of one run, s (default: the parameters')")->check(CLI::Range(1.0, 1e6));
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;

  if (name == "list") return list();
  const common::StopSignal signal;
  auto study_result = load_study(name);
  if (!study_result) return fail(study_result.error());
  if (!seeds.empty()) {
    options.seeds = parse_seeds(seeds);
    if (!options.seeds) {
      fmt::print(stderr, "--seeds: got '{}', wanted a number or a range such as 1-10\n", seeds);
      return common::kExitUsage;
    }
  }
  if (timeout) options.timeout = std::chrono::milliseconds(std::llround(*timeout * 1e3));
  options.stop = signal.token();
  options.on_progress = [](const std::string& line) { fmt::print(stderr, "{}\n", line); };

  auto report_result = (*study_result)->run(options);
  if (!report_result) return fail(report_result.error());
  StudyReport& report = *report_result;
  fmt::print("{}", report.table);
  if (!json.empty()) {
    auto files_result = study_files(name);
    if (!files_result) return fail(files_result.error());
    report.json["files"] = *files_result;
    if (auto ok = common::write_results(json, report.json); !ok) return fail(ok.error());
  }
  if (!picture.empty()) {
    if (report.panels.empty()) {
      fmt::print(stderr, "--plot: this study is a table, it has no figure\n");
      return common::kExitUsage;
    }
    if (auto ok = common::plot(picture, (*study_result)->title(), report.panels); !ok) return fail(ok.error());
  }
  return report.broken ? common::kExitFailed : common::kExitOk;
}
