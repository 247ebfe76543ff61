#include "services/task/run/report.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "physics_pool/scene/task_kind.hpp"
#include "services/common/process/child_process.hpp"
#include "services/common/process/files.hpp"
#include "services/common/results/results.hpp"

namespace jostle::task {
namespace {

using nlohmann::json;

constexpr std::size_t kMostFrames = 8;  // in the picture

// Frames of the picture: evenly spread, first and last always among them.
json frames_of(const json& states, const RunOptions& options, const json& report) {
  json frames = json::array();
  const std::size_t count = states.size();
  const std::size_t shown = std::min(count, kMostFrames);
  const bool success = report["success"];
  for (std::size_t i = 0; i < shown; ++i) {
    const std::size_t at = shown == 1 ? 0 : i * (count - 1) / (shown - 1);
    std::string caption = fmt::format("{}t = {} s", options.plan_only ? "plan, " : "", at);
    if (at + 1 == count && !options.plan_only) {
      caption += success ? fmt::format("  ({})", physics_pool::find_task_kind(options.scene.task.kind)->achieved)
                         : fmt::format("  ({})", report["reason"].get<std::string>());
    }
    frames.push_back({{"caption", caption}, {"q", states[at]}});
  }
  return frames;
}

Result<void> draw(const RunOptions& options, const json& report) {
  const json& states = report[options.plan_only ? "plan_states" : "observed_states"];
  const json input{{"scene", physics_pool::to_yaml(options.plan_only ? options.planning : options.scene)},
                   {"frames", frames_of(states, options, report)}};
  const std::filesystem::path base = options.picture.string() + ".frames";
  const auto frames_file = base.string() + ".json", log_file = base.string() + ".log";
  if (auto ok = common::write_text(frames_file, input.dump()); !ok) return ok;
  // A process of its own: off-screen drawing needs libraries that no run does.
  auto child_result = common::ChildProcess::start(
      common::program_folder() / "jostle_render",
      {frames_file, "-o", options.picture.string(), "--columns", "4", "--size", "480x360"}, log_file);
  if (!child_result) return child_result.error();
  const common::ExitStatus ended = child_result->wait();
  const std::string words = child_result->last_words();
  std::filesystem::remove(frames_file);
  std::filesystem::remove(log_file);
  if (ended.ok()) return {};
  return Error{Code::kIo, fmt::format("{}: not drawn, {}\n{}", options.picture.string(), ended.text(), words)};
}

void print_summary(const json& report) {
  fmt::print("\n{}: {}\n", report["success"].get<bool>() ? "SUCCESS" : "FAILURE", report["reason"].get<std::string>());
  fmt::print("  first plan   {:.1f} s, {} iterations, cost {:.1f}, hash {}\n", report["plan_seconds"].get<double>(),
             report["iterations"].get<int>(), report["cost"].get<double>(), report["plan_hash"].get<std::string>());
  fmt::print("  execution    {} actions, {} re-plans, {:.1f} s in all\n", report["actions"].get<int>(),
             report["replans"].get<int>(), report["total_seconds"].get<double>());
  fmt::print("  physics      {} rollouts, {} x {} ({})\n", report["rollouts"].get<std::uint64_t>(),
             report["used_workers"].size(), report["pool"].get<std::string>() == "dds" ? "worker process" : "thread",
             report["controller"].get<std::string>());
}

}  // namespace

Result<void> leave_report(const RunOptions& options, const jostle_msgs::msg::GoalResult& result) {
  json report = json::parse(result.report(), nullptr, false);
  if (report.is_discarded()) {
    return Error{Code::kInternal, "result: the coordinator's report is not JSON"};
  }
  report["controller"] = options.controller;
  report["predictor"] = options.predictor;
  report["uncertainty"] = physics_pool::to_string(options.level);
  report["pool"] = options.pool;
  report["workers"] = options.workers;
  report["scene"] = options.scene.name;
  report["parameters"] = options.parameters;
  print_summary(report);
  if (!options.picture.empty()) {
    if (auto ok = draw(options, report); !ok) return ok;
    fmt::print("  picture      {}\n", options.picture.string());
  }
  if (!options.json.empty()) {
    if (auto ok = common::write_results(options.json, report); !ok) return ok;
    fmt::print("  numbers      {}\n", options.json.string());
  }
  return {};
}

}  // namespace jostle::task
