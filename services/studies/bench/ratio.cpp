#include "services/studies/bench/ratio.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "services/common/results/results.hpp"

namespace jostle::studies {

void Ratio::add_options(CLI::App& app) {
  app.add_option("--repeats", settings_.repeats, "Runs of each side, after one that is not counted")
      ->capture_default_str()
      ->check(CLI::Range(1, 100'000));
  add_json(app);
}

Result<int> Ratio::run(const Start& start) {
  Measurements done;
  settings_.domain = start.domain;
  settings_.stop = start.stop;
  settings_.line = start.line;
  settings_.done = &done;
  const auto measured = measure_(settings_);
  start.line->end();
  for (const Measurement& measurement : done) fmt::print("{}", to_text(measurement));
  const bool complete = measured && !start.stop.stop_requested();
  if (!json.empty() && (complete || !done.empty())) {
    nlohmann::json results{{"results", to_json(done)}};
    if (!complete) results["partial"] = true;
    if (auto ok = common::write_results(json, std::move(results)); !ok) return ok.error();
  }
  if (start.stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
  if (!measured) return measured.error();
  return int{std::ranges::all_of(done, &Measurement::agrees) ? common::kExitOk : common::kExitFailed};
}

void RatioOfWorkers::add_options(CLI::App& app) {
  settings_.workers = {64};
  app.add_option("--workers", settings_.workers, "Worker processes, such as 8,16,64: one measurement each")
      ->capture_default_str()
      ->delimiter(',')
      ->check(CLI::Range(1, 1024));
  Ratio::add_options(app);
}

void RatioOfLanes::add_options(CLI::App& app) {
  settings_.hosts = {1, 4, 16};
  app.add_option("--hosts", settings_.hosts, "Hosts with a worker process each, such as 1,4,16: one measurement each")
      ->capture_default_str()
      ->delimiter(',')
      ->check(CLI::Range(1, 200));
  app.add_option("--lanes", settings_.lanes, "Threads of each worker")
      ->capture_default_str()
      ->check(CLI::Range(1, 1024));
  app.add_option("--steps", settings_.steps, "Control steps of the plan that assignments carry")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  Ratio::add_options(app);
}

}  // namespace jostle::studies
