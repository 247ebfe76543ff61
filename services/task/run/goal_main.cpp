// jostle goal: gives a scene to a coordinator and a world that run already.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "services/common/process/program.hpp"
#include "services/task/run/display.hpp"
#include "services/task/run/goal_client.hpp"
#include "services/task/run/report.hpp"
#include "services/world/link/messages.hpp"

namespace {

using namespace jostle;
using namespace jostle::task;
using Clock = GoalClient::Clock;

constexpr std::chrono::milliseconds kTick{50};
constexpr std::chrono::seconds kWarnAfter{5};       // of silence
constexpr std::chrono::seconds kCancelPatience{5};  // for the answer to a cancel

int fail(const Error& error, int code) {
  fmt::print(stderr, "jostle goal: {}\n", error.message);
  return code;
}

// Waits until one coordinator and a world are there, and gives the coordinator the goal.
Result<void> send(GoalClient& client, const RunOptions& options, const wire::Participant& participant, double patience,
                  std::stop_token stop) {
  const int domain = participant.domain();
  const auto deadline =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(patience));
  for (;;) {
    client.listen();
    const std::vector<std::uint64_t> found = client.coordinators();
    const bool answers = found.size() == 1 && client.reaches(found.front());
    if (answers && client.world_heard()) {
      if (auto ok = world::check_scene(client.world_scene(), scene_hash(options.scene)); !ok) return ok;
      if (client.send(make_goal(options), found.front())) return {};
    }
    if (!common::pause_until(Clock::now() + kTick, stop)) return Error{Code::kCancelled, "interrupted"};
    if (Clock::now() < deadline) continue;
    if (found.size() > 1) {
      return Error{Code::kUnavailable,
                   fmt::format("domain {}: got {} coordinators, wanted one; --namespace tells robots apart", domain,
                               found.size())};
    }
    return Error{Code::kUnavailable,
                 fmt::format("domain {}: no {} heard for {:g} s; start one with `jostle {}`, or see `jostle doctor`{}",
                             domain, answers ? "world was" : "coordinator was", patience,
                             answers ? "sim SCENE" : "coordinator", participant.possible_cause())};
  }
}

// Waits for the result, and says when nothing was heard for long.
Result<jostle_msgs::msg::GoalResult> follow(GoalClient& client, common::LiveLine& line, std::stop_token stop) {
  auto warned = Clock::now();
  for (;;) {
    if (auto result = client.wait(Clock::now() + kTick, stop)) return *std::move(result);
    client.listen();
    if (stop.stop_requested()) break;
    if (auto ok = client.check_at_work(); !ok) return ok.error();
    const auto now = Clock::now();
    if (client.coordinators().empty()) {
      return Error{Code::kUnavailable, "the coordinator is gone; whether the robot stands still is for you to see"};
    }
    if (now - *client.coordinator_heard() > kWarnAfter && now - warned > kWarnAfter) {
      warned = now;
      line.say("the coordinator was not heard for {:.0f} s; waiting",
               std::chrono::duration<double>(now - *client.coordinator_heard()).count());
    }
  }
  client.cancel();
  if (auto result = client.wait(Clock::now() + kCancelPatience, {})) return *std::move(result);
  return Error{Code::kCancelled, "interrupted; whether the task was cancelled is not known, nobody answered"};
}

// JSON, which is YAML as well.
std::string action_text(const jostle_msgs::msg::Goal& goal) {
  const nlohmann::json fields{{"execution_scene", goal.execution_scene()},
                              {"planning_scene", goal.planning_scene()},
                              {"parameters", goal.parameters()},
                              {"controller", goal.controller()},
                              {"predictor", goal.predictor()},
                              {"seed", goal.seed()},
                              {"plan_only", goal.plan_only()}};
  return nlohmann::json{{"goal", fields}}.dump();
}

int perform(const RunOptions& options, double patience, std::stop_token stop) {
  auto participant_result =
      wire::Participant::open({.name = "jostle_goal", .domain = options.domain, .role = wire::Role::kRobot});
  if (!participant_result) return fail(participant_result.error(), common::exit_code_of(participant_result.error()));
  common::LiveLine line("jostle goal", options.headless ? common::PlainLines::kAlways : common::PlainLines::kElsewhere);
  Display display(line);
  GoalClient client(*participant_result, fmt::format("goal-{:016x}", participant_result->id()),
                    {.on_feedback = [&](const auto& feedback) { display.show(feedback); },
                     .on_notice = [&](const std::string& text) { line.say("{}", text); }});
  if (auto ok = send(client, options, *participant_result, patience, stop); !ok) {
    return fail(ok.error(), common::exit_code_of(ok.error()));
  }
  auto result = follow(client, line, std::move(stop));
  line.finish();
  if (!result) return fail(result.error(), common::exit_code_of(result.error()));
  if (auto ok = leave_report(options, *result); !ok) return fail(ok.error(), common::kExitBroken);
  const int code = exit_code_of(*result);
  const std::string error = error_of(*result);
  return error.empty() ? code : fail({Code::kUnavailable, error}, code);
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Gives a goal to a coordinator that runs, for a world that runs, and waits for its end. `jostle run` is the\n"
      "same with a coordinator, a world and workers of its own.",
      "jostle goal");
  GoalArguments arguments;
  RunOptions options{.pool = ""};
  double patience = 15.0;
  bool print = false;
  add_goal_options(app, arguments, options);
  app.add_flag("--print-action", print,
               "Send nothing: print the goal as `ros2 action send_goal /grasp jostle_msgs/action/Manipulate` wants it");
  app.add_option("--wait", patience, "Seconds to wait for coordinator and world")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 86400.0));
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  const common::StopSignal signal;
  if (auto ok = complete(arguments, options); !ok) return fail(ok.error(), common::exit_code_of(ok.error()));
  if (print) {
    fmt::print("{}\n", action_text(make_goal(options)));
    return common::kExitOk;
  }
  try {
    return perform(options, patience, signal.token());
  } catch (const wire::SetupError& error) {
    return fail({Code::kUnavailable, error.what()}, common::kExitBroken);
  }
}
