#include "services/task/run/arm.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <utility>

#include "services/task/run/options.hpp"
#include "services/world/arm/arm_scene.hpp"

namespace jostle::task {
namespace {

// An address of this host's own for each domain, so that several runs have controllers with the same ports.
std::string controller_address(int domain) { return fmt::format("127.0.1.{}", domain + 1); }
std::string mocap_address(int domain) { return fmt::format("127.0.6.{}", domain + 1); }

}  // namespace

Result<Arm> parse_arm(const std::string& text) {
  constexpr std::string_view kUr = "ur:";
  if (text == "sim") return Arm{};
  if (text == "ur-sim") return Arm{.kind = Arm::Kind::kUrSim, .host = {}};
  if (text.starts_with(kUr) && text.size() > kUr.size())
    return Arm{.kind = Arm::Kind::kUr, .host = text.substr(kUr.size())};
  return Error{Code::kInvalidArgument, fmt::format("--arm: got '{}', wanted sim, ur-sim or ur:HOST", text)};
}

Result<void> check_arm(const Arm& arm, const physics_pool::Scene& scene) {
  if (arm.kind == Arm::Kind::kSim) return {};
  if (auto arm_result = world::with_arm(scene, {}); !arm_result) {
    return Error{Code::kInvalidArgument, fmt::format("--arm: scene '{}': {}", scene.name, arm_result.error().message)};
  }
  return {};
}

Result<Sensor> parse_sensor(const std::string& text) {
  constexpr std::string_view kMocap = "mocap:";
  if (text == "sim") return Sensor{};
  if (text == "camera-sim") return Sensor{.kind = Sensor::Kind::kCameraSim, .host = {}};
  if (text == "mocap-sim") return Sensor{.kind = Sensor::Kind::kMocapSim, .host = {}};
  if (text.starts_with(kMocap) && text.size() > kMocap.size())
    return Sensor{.kind = Sensor::Kind::kMocap, .host = text.substr(kMocap.size())};
  return Error{Code::kInvalidArgument,
               fmt::format("--objects: got '{}', wanted sim, mocap-sim, camera-sim or mocap:HOST", text)};
}

std::vector<Part> parts_of_world(const RunOptions& options, const std::filesystem::path& scene,
                                 const std::filesystem::path& belief, int domain) {
  const std::vector<std::string> of_run{"--domain", std::to_string(domain), "--die-with-parent",
                                        std::to_string(getpid())};
  const auto part = [&](std::string title, std::string program, std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), of_run.begin(), of_run.end());
    return Part{std::move(title), std::move(program), std::move(arguments)};
  };
  const auto bridge = [&](const std::string& host, const std::vector<std::string>& more) {
    std::vector<std::string> arguments{"ur5", "--host", host};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return part("the bridge", "bridge", arguments);
  };
  std::vector<Part> parts;
  std::vector<std::string> seen_by;  // of what simulates the objects
  if (options.sensor.kind == Sensor::Kind::kCameraSim) {
    seen_by = {"--camera"};
    parts.push_back(part("the eyes", "perceive", {"camera", "camera", "--scene", scene.string()}));
  } else if (options.sensor.kind != Sensor::Kind::kSim) {
    const bool simulated = options.sensor.kind == Sensor::Kind::kMocapSim;
    const std::string host = simulated ? mocap_address(domain) : options.sensor.host;
    if (simulated) {
      seen_by = world::arguments_of(options.mocap_faults);
      seen_by.insert(seen_by.end(), {"--mocap", host});
    }
    // A simulated world has a clock of its own, which the frames tell.
    const char* stamps = options.arm.kind == Arm::Kind::kSim ? "server" : "host";
    parts.push_back(
        part("the eyes", "perceive", {"mocap", "--host", host, "--stamps", stamps, "--scene", belief.string()}));
  }
  const auto simulating = [&](std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), seen_by.begin(), seen_by.end());
    return arguments;
  };
  switch (options.arm.kind) {
    case Arm::Kind::kUr:
      parts.push_back(bridge(options.arm.host, {"--scene", scene.string()}));
      break;
    case Arm::Kind::kUrSim: {
      const std::string address = controller_address(domain);
      parts.push_back(part("the simulated arm", "ur_sim", simulating({scene.string(), "--address", address})));
      // It can do no harm, and this machine may be busy.
      parts.push_back(bridge(address, {"--scene", scene.string(), "--silence", "1", "--watchdog", "1"}));
      break;
    }
    case Arm::Kind::kSim:
      parts.push_back(
          part("the simulated world", "sim",
               simulating({scene.string(), "--belief", belief.string(), "--uncertainty",
                           physics_pool::to_string(options.level), "--seed", std::to_string(options.seed), "--noise",
                           fmt::format("{}", options.noise), "--rate", fmt::format("{}", options.rate)})));
      break;
  }
  return parts;
}

std::chrono::seconds patience(const Arm& arm) {
  return std::chrono::seconds(arm.kind == Arm::Kind::kSim ? 15
                                                          : 45);  // an arm is switched on, and its gripper activated
}

Result<Drawn> drawn(const Arm& arm, const physics_pool::Scene& scene, const std::vector<std::vector<double>>& states) {
  if (arm.kind == Arm::Kind::kSim) return Drawn{scene, states};
  auto scene_result = world::with_arm(scene, {});
  if (!scene_result) return scene_result.error();
  Drawn result{std::move(scene_result).value(), {}};
  const std::size_t joints = scene.robot.q.size();
  for (const std::vector<double>& state : states) {
    auto q_result = world::arm_joints(std::span(state).first(joints), {});
    if (!q_result) return q_result.error();
    result.states.push_back(std::move(q_result).value());
    result.states.back().insert(result.states.back().end(), state.begin() + static_cast<std::ptrdiff_t>(joints),
                                state.end());
  }
  return result;
}

}  // namespace jostle::task
