// jostle run: one scene, from start to grasp or goal, on this machine.

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "services/common/process/command_line.hpp"
#include "services/common/process/cores.hpp"
#include "services/common/process/program.hpp"
#include "services/task/run/display.hpp"
#include "services/task/run/report.hpp"
#include "services/task/run/session.hpp"

namespace {

using namespace jostle;
using namespace jostle::task;

constexpr std::uint16_t kViewPort = 8765;  // where Foxglove looks

int fail(const Error& error, int code) {
  fmt::print(stderr, "jostle run: {}\n", error.message);
  return code;
}

int perform(const RunOptions& options, std::stop_token stop) {
  common::LiveLine line("jostle run", options.headless ? common::PlainLines::kAlways : common::PlainLines::kElsewhere);
  Display display(line);
  auto session_result = Session::start(options, {.on_feedback = [&](const auto& feedback) { display.show(feedback); },
                                                 .on_notice = [&](const std::string& text) { line.say("{}", text); }});
  if (!session_result) {
    return fail(session_result.error(), common::exit_code_of(session_result.error()));
  }
  auto result = (*session_result)->perform(stop);
  line.finish();
  if (!result) {
    session_result->reset();
    if (!options.record.empty()) line.say("the bag without its end is {}", options.record.string());
    return fail(result.error(),
                result.error().code == Code::kCancelled ? common::kExitInterrupted : common::kExitBroken);
  }
  const auto recorded = (*session_result)->finish_recording();
  session_result->reset();  // before drawing: every process it started is gone
  RunOptions told = options;
  if (!recorded) told.record.clear();  // it is no bag to be replayed
  if (auto ok = leave_report(told, *result); !ok) return fail(ok.error(), common::kExitBroken);
  if (!recorded) return fail(recorded.error(), common::kExitBroken);
  const int code = exit_code_of(*result);
  const std::string error = error_of(*result);
  return error.empty() ? code : fail({Code::kUnavailable, error}, code);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Plans and executes a scene: starts workers, a simulated world and a coordinator, shows\n"
      "their progress, and ends them. More workers may join from anywhere: jostle worker.",
      "jostle run");
  GoalArguments arguments;
  RunOptions options;
  options.workers = common::usable_cores();
  bool pin = false;
  std::string arm = "sim", objects = "sim";
  add_goal_options(app, arguments, options);
  common::add_count_option(app, "--workers", options.workers, 0,
                           "Worker processes, or threads; auto: one per core this process may use")
      ->default_str("auto");
  app.add_flag("--pin", pin, "Give each worker process a core of its own, in turn");
  app.add_option("--pool", options.pool, "dds: worker processes; threads: threads of the coordinator")
      ->capture_default_str()
      ->check(CLI::IsMember({"dds", "threads"}));
  app.add_option("--record", options.record, "Folder for a bag of the whole run; `jostle record` has more to say");
  app.add_option(
         "--noise", arguments.noise,
         "How the simulated world's noise grows with speed (b of Eq. 5.10; thesis: 0.05, 0.075, 0.1), and, unless\n"
         "--set adaptive.noise=… says otherwise, how the planner believes it to (default: 0, and the parameter's)")
      ->check(CLI::Range(0.0, 1.0));
  auto* view = app.add_option("--view", options.view,
                              "Show the run in a browser and in Foxglove, at this port (default: 8765; 0: any)")
                   ->expected(0, 1)
                   ->type_name("PORT")
                   ->check(common::port());
  app.add_option("--rate", options.rate, "World seconds per second while acting; 0: as fast as possible")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option("--arm", arm,
                 "What moves: sim, the planner's own robot; ur-sim, a UR5 behind a simulated controller;\n"
                 "ur:HOST, a UR5 (read docs/robots.md first)")
      ->capture_default_str();
  app.add_option(
         "--objects", objects,
         "Who sees the objects: sim, the simulated world itself; mocap-sim, a motion capture that is simulated;\n"
         "camera-sim, a camera that looks at rendered tags on the objects; mocap:HOST, a motion capture that speaks\n"
         "NatNet (docs/perception.md)")
      ->capture_default_str();
  world::add_mocap_fault_options(app, options.mocap_faults);
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  if (*view && view->results().front().empty()) options.view = kViewPort;
  if (options.pool == "threads" && options.workers == 0) {
    return fail({Code::kInvalidArgument, "--workers: got 0, wanted at least 1 thread"}, common::kExitUsage);
  }
  if (pin && options.pool == "threads") {
    return fail({Code::kInvalidArgument, "--pin: got --pool threads, wanted dds: only worker processes are pinned"},
                common::kExitUsage);
  }
  auto arm_result = parse_arm(arm);
  if (!arm_result) return fail(arm_result.error(), common::kExitUsage);
  options.arm = std::move(arm_result).value();
  auto sensor_result = parse_sensor(objects);
  if (!sensor_result) return fail(sensor_result.error(), common::kExitUsage);
  options.sensor = std::move(sensor_result).value();
  if (options.sensor.kind == Sensor::Kind::kMocap && options.arm.kind != Arm::Kind::kUr) {
    return fail({Code::kInvalidArgument,
                 "--objects: got " + objects + ", wanted sim or mocap-sim: the arm's world is simulated"},
                common::kExitUsage);
  }
  if (!options.mocap_faults.are_none() && options.sensor.kind != Sensor::Kind::kMocapSim) {
    return fail({Code::kInvalidArgument,
                 fmt::format("--objects: got {} with --mocap-…, wanted mocap-sim: only it has faults", objects)},
                common::kExitUsage);
  }
  if (options.sensor.kind == Sensor::Kind::kCameraSim && options.arm.kind == Arm::Kind::kUr) {
    return fail({Code::kInvalidArgument, fmt::format("--objects: got camera-sim with --arm {}, wanted --arm sim or "
                                                     "ur-sim: only the world of a simulated arm is rendered",
                                                     arm)},
                common::kExitUsage);
  }
  if (options.sensor.kind == Sensor::Kind::kCameraSim && arguments.level != "none") {
    return fail({Code::kInvalidArgument, "--uncertainty: got " + arguments.level +
                                             " with --objects camera-sim, wanted none: a camera sees what is there"},
                common::kExitUsage);
  }
  if (options.arm.kind != Arm::Kind::kSim && arguments.level != "none") {
    return fail({Code::kInvalidArgument, "--uncertainty: got --arm " + arm + ", wanted sim: only it is disturbed"},
                common::kExitUsage);
  }
  if (options.arm.kind != Arm::Kind::kSim && arguments.noise) {
    return fail({Code::kInvalidArgument, "--noise: got --arm " + arm + ", wanted sim: only it is disturbed"},
                common::kExitUsage);
  }
  if (pin) options.cores = common::allowed_cores();
  const common::StopSignal signal;
  if (auto ok = complete(arguments, options); !ok) return fail(ok.error(), common::exit_code_of(ok.error()));
  if (auto ok = check_arm(options.arm, options.scene); !ok) return fail(ok.error(), common::kExitUsage);
  try {
    return perform(options, signal.token());
  } catch (const wire::SetupError& error) {
    return fail({Code::kUnavailable, error.what()}, common::kExitBroken);
  }
}
