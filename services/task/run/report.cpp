#include "services/task/run/report.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "idl/text/json.hpp"
#include "planners/execution/execution.hpp"
#include "services/common/process/child_process.hpp"
#include "services/common/process/exit_codes.hpp"
#include "services/common/process/files.hpp"
#include "services/common/results/results.hpp"

namespace jostle::task {
namespace {

using nlohmann::json;
namespace endings = jostle_msgs::msg::GoalResult_Constants;

constexpr std::size_t kMostFrames = 8;  // in the picture

// Times, s, of the states that are drawn.
std::vector<double> times_of(const RunOptions& options, const json& report) {
  if (!options.plan_only) return report["observed_times"].get<std::vector<double>>();
  std::vector<double> times;
  for (std::size_t i = 0; i < report["plan_states"].size(); ++i) {
    times.push_back(static_cast<double>(i) * report["step_duration"].get<double>());
  }
  return times;
}

// Frames of the picture: evenly spread, first and last always among them.
json frames_of(const json& states, const RunOptions& options, const json& report) {
  json frames = json::array();
  const std::vector<double> times = times_of(options, report);
  const std::size_t count = states.size();
  const std::size_t shown = std::min(count, kMostFrames);
  for (std::size_t i = 0; i < shown; ++i) {
    const std::size_t at = shown == 1 ? 0 : i * (count - 1) / (shown - 1);
    std::string caption = fmt::format("{}t = {:.3g} s", options.plan_only ? "plan, " : "", times.at(at) - times.at(0));
    if (at + 1 == count && !options.plan_only) {
      caption += fmt::format("  ({})", report["reason"].get<std::string>());
    }
    frames.push_back({{"caption", caption}, {"q", states[at]}});
  }
  return frames;
}

// What the numbers of states and controls are.
json layout(const physics_pool::Scene& scene) {
  const physics_pool::RobotModel& robot = scene.robot.model;
  json q = json::array(), q_units = json::array(), v = json::array(), v_units = json::array();
  for (const physics_pool::Joint& joint : robot.joints) {
    const bool slides = joint.kind == physics_pool::JointKind::kSlide;
    q.push_back(joint.name);
    v.push_back(joint.name);
    q_units.push_back(slides ? "m" : "rad");
    v_units.push_back(slides ? "m/s" : "rad/s");
  }
  for (const ObjectSlot& object : physics_pool::layout_of(scene).objects) {
    for (const char* part : {"x", "y", "z", "qw", "qx", "qy", "qz"}) {
      q.push_back(fmt::format("{}.{}", object.name, part));
      q_units.push_back(part[0] == 'q' ? "" : "m");
    }
    for (const char* part : {"vx", "vy", "vz", "wx", "wy", "wz"}) {
      v.push_back(fmt::format("{}.{}", object.name, part));
      v_units.push_back(part[0] == 'v' ? "m/s" : "rad/s");
    }
  }
  json u = json::array(), u_units = json::array();
  for (const physics_pool::Axis& axis : robot.axes) {
    u.push_back(axis.name);
    const auto joint = static_cast<std::size_t>(axis.joints.front().first);
    u_units.push_back(robot.joints.at(joint).kind == physics_pool::JointKind::kSlide ? "m/s" : "rad/s");
  }
  return {{"q", q}, {"q_units", q_units}, {"v", v}, {"v_units", v_units}, {"u", u}, {"u_units", u_units}};
}

// Where the summary goes: not between the bytes of a file that goes to standard output.
std::FILE* summary_of(const RunOptions& options) {
  return files::is_standard(options.json) || files::is_standard(options.picture) ? stderr : stdout;
}

// In a process of its own: off-screen drawing needs libraries that no run does.
Result<void> draw_in(const std::filesystem::path& folder, const std::filesystem::path& picture,
                     const std::string& frames) {
  const auto frames_file = folder / "frames.json", drawn = folder / "picture.png";
  if (auto ok = common::write_text(frames_file, frames); !ok) return ok;
  auto child_result =
      common::ChildProcess::start(common::program_folder() / "jostle_render",
                                  {frames_file, "-o", drawn, "--columns", "4", "--size", "480x360"}, folder / "log");
  if (!child_result) return child_result.error();
  const common::ExitStatus ended = child_result->wait();
  if (!ended.ok()) {
    return Error{Code::kIo,
                 fmt::format("{}: not drawn, {}\n{}", picture.string(), ended.text(), child_result->last_words())};
  }
  const auto bytes_result = common::read_text(drawn);
  if (!bytes_result) return bytes_result.error();
  return common::write_text(picture, *bytes_result);
}

Result<void> draw(const RunOptions& options, const json& report) {
  const json& states = report[options.plan_only ? "plan_states" : "observed_states"];
  if (states.empty()) {
    fmt::print(summary_of(options), "  picture      not drawn: there is no plan\n");
    return {};
  }
  const auto drawn_result = drawn(options.arm, options.plan_only ? options.planning : options.scene, states);
  if (!drawn_result) return drawn_result.error();
  const json input{{"scene", physics_pool::to_yaml(drawn_result->scene)},
                   {"frames", frames_of(drawn_result->states, options, report)}};
  const auto folder_result = common::make_temporary_folder("picture");
  if (!folder_result) return folder_result.error();
  auto drawn = draw_in(*folder_result, options.picture, input.dump());
  std::error_code ignored;
  std::filesystem::remove_all(*folder_result, ignored);
  if (drawn) fmt::print(summary_of(options), "  picture      {}\n", options.picture.string());
  return drawn;
}

// How an ending is told: to people, and to whoever started the program.
struct Told {
  const char* headline;
  common::ExitCode code;
};

Told told(std::uint8_t ending) {
  switch (ending) {
    case endings::SUCCEEDED:
      return {"SUCCESS", common::kExitOk};
    case endings::CANCELLED:
      return {"CANCELLED", common::kExitInterrupted};
    case endings::BROKEN:
    case endings::REFUSED:
      return {"BROKEN", common::kExitBroken};
    case endings::INVALID:
      return {"INVALID", common::kExitUsage};
    default:
      return {"FAILURE", common::kExitFailed};
  }
}

void print_summary(const RunOptions& options, const json& report) {
  std::FILE* out = summary_of(options);
  if (report["cost"].is_null()) {
    fmt::print(out, "  first plan   none was finished within {:.1f} s\n", report["total_seconds"].get<double>());
  } else {
    fmt::print(out, "  first plan   {:.1f} s, {} iterations, cost {:.1f}, hash {}\n",
               report["plan_seconds"].get<double>(), report["iterations"].get<int>(), report["cost"].get<double>(),
               report["plan_hash"].get<std::string>());
  }
  fmt::print(out, "  execution    {} actions, {} re-plans, {:.1f} s in all\n", report["actions"].get<int>(),
             report["replans"].get<int>(), report["total_seconds"].get<double>());
  if (!report["idle"]["median"].is_null()) {
    fmt::print(out,
               "  idle         {:.2f} s before an action (90 %: {:.2f} s); {} plans begun while acting, {} taken\n",
               report["idle"]["median"].get<double>(), report["idle"]["p90"].get<double>(),
               report["plans_while_acting"].get<int>(), report["taken_while_acting"].get<int>());
  }
  fmt::print(out, "  physics      {} rollouts on {} {}, controller {}\n", report["rollouts"].get<std::uint64_t>(),
             report["used_workers"].size(), options.pool == "threads" ? "threads" : "workers", options.controller);
  for (const ParameterDifference& change : options.changed) {
    fmt::print(out, "  parameter    {} {}, by default {}\n", change.key, to_text(change.after), to_text(change.before));
  }
  if (!options.record.empty()) {
    const std::string bag = options.record.string();
    fmt::print(out, "  bag          {}; {}\n", bag,
               report["cost"].is_null() ? "it has no plan to be made again"
                                        : fmt::format("`jostle replay {}` makes its decisions again", bag));
  }
}

json changes_of(const RunOptions& options) {
  json changes = json::object();
  const auto as_json = [](const ParameterValue& value) {
    return std::visit([](const auto& v) { return json(v); }, value);
  };
  for (const ParameterDifference& change : options.changed) {
    changes[change.key] = {{"value", as_json(change.after)}, {"default", as_json(change.before)}};
  }
  return changes;
}

}  // namespace

std::string error_of(const jostle_msgs::msg::GoalResult& result) {
  return result.ending() == endings::CANCELLED ? "interrupted; the task was cancelled" : result.error();
}

Result<void> leave_report(const RunOptions& options, const jostle_msgs::msg::GoalResult& result) {
  std::FILE* out = summary_of(options);
  if (result.report().empty() && !result.error().empty()) return {};
  fmt::print(out, "\n{}: {}\n", told(result.ending()).headline, result.reason());
  auto report_result = parse_json(result.report());
  if (!report_result)
    return Error{Code::kInternal, "result: the coordinator's report: " + report_result.error().message};
  json& report = *report_result;
  if (!result.error().empty()) {  // a part that failed is the reason, not what the coordinator was told to do then
    report["success"] = false;
    report["ending"] = planners::to_string(static_cast<planners::Ending>(result.ending()));
    report["reason"] = error_of(result);
  }
  report["controller"] = options.controller;
  report["predictor"] = options.predictor;
  report["uncertainty"] = physics_pool::to_string(options.level);
  report["noise"] = options.noise;
  if (!options.pool.empty()) {  // otherwise the coordinator has one that we know nothing of
    report["pool"] = options.pool;
    report["workers"] = options.workers;
  }
  report["scene"] = options.scene.name;
  report["parameters"] = options.parameters;
  report["changed_parameters"] = changes_of(options);
  report["layout"] = layout(options.scene);
  print_summary(options, report);
  auto drawn = options.picture.empty() ? Result<void>() : draw(options, report);
  if (!options.json.empty()) {
    if (auto ok = common::write_results(options.json, report); !ok) return ok;
    fmt::print(summary_of(options), "  numbers      {}\n", options.json.string());
  }
  return drawn;  // not before: numbers are worth more than a picture
}

int exit_code_of(const jostle_msgs::msg::GoalResult& result) { return told(result.ending()).code; }

}  // namespace jostle::task
