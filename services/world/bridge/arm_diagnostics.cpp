#include "services/world/bridge/arm_diagnostics.hpp"

#include <fmt/format.h>

#include <numbers>
#include <utility>

#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

namespace level = diagnostic_msgs::msg::DiagnosticStatus_Constants;
using diagnostic_msgs::msg::DiagnosticStatus;
using robot_bridge::robotiq::Object;
using robot_bridge::ur::RuntimeState;

void add(DiagnosticStatus& status, std::string key, std::string value) {
  diagnostic_msgs::msg::KeyValue pair;
  pair.key(std::move(key));
  pair.value(std::move(value));
  status.values().push_back(std::move(pair));
}

DiagnosticStatus status_of(const char* name, const std::string& host, const std::string& trouble) {
  DiagnosticStatus status;
  status.level(trouble.empty() ? level::OK : level::ERROR);
  status.name(name);
  status.message(trouble.empty() ? "ready" : trouble);
  status.hardware_id(host);
  return status;
}

const char* name_of(Object object) {
  switch (object) {
    case Object::kMoving:
      return "moving";
    case Object::kMetWhileOpening:
      return "met while opening";
    case Object::kMetWhileClosing:
      return "met while closing";
    case Object::kAtRequest:
      break;
  }
  return "none";
}

DiagnosticStatus arm_status(const robot_bridge::ur::ArmHand::Condition& condition, const std::string& host) {
  const auto& arm = condition.arm;
  DiagnosticStatus status = status_of("ur5: arm", host, condition.arm_trouble);
  if (!arm.is_connected) {
    status.level(level::STALE);
    return status;
  }
  add(status, "robot mode", std::string(robot_bridge::ur::name_of(arm.state.robot_mode)));
  add(status, "safety mode", std::string(robot_bridge::ur::name_of(arm.state.safety_mode)));
  add(status, "program", arm.state.runtime_state == RuntimeState::kPlaying ? "running" : "not running");
  add(status, "speed scaling", fmt::format("{:.2f}", arm.state.speed_scaling));
  add(status, "cycles", fmt::format("{}", arm.cycles));
  add(status, "missed cycles", fmt::format("{}", arm.missed));
  if (const auto& off = condition.calibration) {
    add(status, "calibration: hand off by, mm", fmt::format("{:.2f}", 1e3 * off->distance));
    add(status, "calibration: hand off by, degrees", fmt::format("{:.3f}", off->angle * 180 / std::numbers::pi));
  }
  return status;
}

}  // namespace

diagnostic_msgs::msg::DiagnosticArray diagnostics_of(const robot_bridge::ur::ArmHand::Condition& condition,
                                                     const std::string& host, double stamp) {
  diagnostic_msgs::msg::DiagnosticArray message;
  message.header(make_header(stamp));
  message.status().push_back(arm_status(condition, host));
  if (const auto& gripper = condition.gripper) {
    DiagnosticStatus status = status_of("ur5: gripper", host, gripper->is_ready ? "" : gripper->trouble);
    if (!gripper->is_ready) status.level(level::ERROR);
    add(status, "opening, m", fmt::format("{:.4f}", gripper->opening));
    add(status, "object", name_of(gripper->object));
    message.status().push_back(std::move(status));
  }
  return message;
}

}  // namespace jostle::world
