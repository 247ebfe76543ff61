// jostle bridge: a robot's own protocols on one side, our topics on the other.

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <numbers>
#include <optional>

#include "services/common/process/command_line.hpp"
#include "services/common/process/domain_claim.hpp"
#include "services/common/process/program.hpp"
#include "services/world/bridge/arm_body.hpp"
#include "services/world/bridge/arm_guard.hpp"

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::world;
  using namespace std::chrono_literals;
  CLI::App app("Drives a robot by its own protocols, and makes it what the planner commands.", "jostle bridge");
  app.require_subcommand(1);
  common::ProcessOptions process;
  robot_bridge::ur::PlanarArmOptions arm_options;
  robot_bridge::robotiq::Client::Options gripper_options;
  std::string gripper = "robotiq";
  double patience = 30.0, silence = 0.06;
  std::string scene_file;
  auto* ur5 = app.add_subcommand("ur5", "A UR5 or UR5e, whose hand moves level above a surface");
  ur5->add_option("--host", arm_options.host, "The controller's address or name")->capture_default_str();
  ur5->add_option("--gripper", gripper, "robotiq: a 2F-85 at the controller's port 63352; none")
      ->capture_default_str()
      ->check(CLI::IsMember({"robotiq", "none"}));
  ur5->add_option("--force", gripper_options.force, "Of the gripper, 0 to 255")
      ->capture_default_str()
      ->check(CLI::Range(0, 255));
  ur5->add_option("--height", arm_options.mounting.height, "Of the hand's middle above the surface, m")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1.0));
  ur5->add_option("--scene", scene_file, "Scene file whose fixtures the arm must not touch (default: none)");
  ur5->add_option("--watchdog", arm_options.watchdog, "Seconds without a word from the bridge that stop the arm")
      ->capture_default_str()
      ->check(CLI::Range(0.02, 10.0));
  ur5->add_flag("!--no-power-up", arm_options.powers_up, "Leave it to people to switch the arm on");
  ur5->add_flag("!--no-recovery", arm_options.recovers, "Leave it to people to unlock a protective stop");
  ur5->add_option("--patience", patience, "Seconds that the arm may take to get ready")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 3600.0));
  ur5->add_option("--silence", silence, "Seconds of a commander's silence that end a motion")
      ->capture_default_str()
      ->check(CLI::Range(0.02, 10.0));
  common::add_process_options(*ur5, process);
  app.footer("Exit codes: 0 stopped by a signal, 2 bad input, 3 the robot is not there or does not get ready.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  common::die_with_parent(process.parent);
  const common::StopSignal signal;
  common::set_up_logging("bridge");
  const auto fail = [](const Error& error) {
    spdlog::error("{}", error.message);
    return common::exit_code_of(error);
  };
  physics_pool::Scene scene;
  if (!scene_file.empty()) {
    auto scene_result = physics_pool::load_scene(scene_file);
    if (!scene_result) return fail(scene_result.error());
    scene = std::move(scene_result).value();
  }
  auto participant_result = wire::Participant::open(
      {.name = "jostle_bridge", .domain = process.domain, .role = wire::Role::kRobot, .waits_for_server = true});
  if (!participant_result) return fail(participant_result.error());
  const auto claim_result =
      common::DomainClaim::take("simulated world", participant_result->domain(), 1s, participant_result->space());
  if (!claim_result) return fail(claim_result.error());
  try {
    robot_bridge::ur::PlanarArm arm(arm_options);
    gripper_options.host = arm_options.host;
    std::optional<robot_bridge::robotiq::Client> client;
    if (gripper == "robotiq") client.emplace(gripper_options);
    robot_bridge::ur::ArmHand hand(arm, client ? &*client : nullptr);
    robot_bridge::Guard guard(hand, arm_guard(hand, arm_options, scene.fixtures));
    ArmBody body(*participant_result, hand, guard, arm_options.mounting,
                 std::chrono::milliseconds(std::lround(1e3 * silence)), arm_options.host);
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(patience);
    std::string said;
    for (std::string trouble; !(trouble = hand.trouble()).empty();) {
      if (trouble != said) spdlog::info("waiting: {}", said = trouble);
      if (std::chrono::steady_clock::now() > deadline)
        return fail(
            {Code::kUnavailable, fmt::format("{}: not ready within {:g} s: {}", arm_options.host, patience, trouble)});
      if (!common::pause_until(std::chrono::steady_clock::now() + 50ms, signal.token())) return common::kExitOk;
    }
    if (const auto off = arm.calibration()) {
      spdlog::info("its calibration puts the hand up to {:.1f} mm and {:.2f} degrees from where it is taken to be",
                   1e3 * off->distance, off->angle * 180 / std::numbers::pi);
    }
    spdlog::info("UR5 at {} ready on domain {}", arm_options.host, participant_result->domain());
    RobotServer server(*participant_result, body);
    if (auto ok = server.run(signal.token()); !ok) return fail(ok.error());
    return common::kExitOk;
  } catch (const wire::SetupError& error) {
    return fail({Code::kUnavailable, error.what()});
  }
}
