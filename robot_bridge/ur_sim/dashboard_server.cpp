#include "robot_bridge/ur_sim/dashboard_server.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <functional>
#include <vector>

namespace jostle::robot_bridge::ur_sim {
namespace {

constexpr const char* kBanner = "Connected: Universal Robots Dashboard Server\n";
constexpr const char* kNotRemote = "Not in remote control mode";

std::string lower(std::string_view text) {
  std::string result(text);
  for (char& c : result) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

std::string program_state(const Controller& controller) {
  const std::string& name = controller.program_name();
  switch (controller.runtime_state()) {
    case ur::RuntimeState::kPlaying:
      return "PLAYING " + name;
    case ur::RuntimeState::kPaused:
      return "PAUSED " + name;
    default:
      return "STOPPED " + name;
  }
}

struct Row {
  std::string_view command;
  bool moves;  // refused where the teach pendant has control
  std::function<std::string(Controller&, const std::string& rest)> answer;
};

const std::vector<Row>& rows() {
  using C = Controller;
  const auto either = [](bool done, const char* yes, const char* no) { return std::string(done ? yes : no); };
  static const std::vector<Row> all{
      {"power on", true,
       [=](C& c, const auto&) {
         const bool on = c.robot_mode() != ur::RobotMode::kPowerOff && c.robot_mode() != ur::RobotMode::kBooting;
         return either(c.power_on() || on, "Powering on", "Failed to execute: power on");
       }},
      {"power off", true,
       [](C& c, const auto&) {
         c.power_off();
         return std::string("Powering off");
       }},
      {"brake release", true,
       [=](C& c, const auto&) {
         return either(c.brake_release() || c.robot_mode() == ur::RobotMode::kRunning, "Brake releasing",
                       "Failed to execute: brake release");
       }},
      {"robotmode", false, [](C& c, const auto&) { return fmt::format("Robotmode: {}", name_of(c.robot_mode())); }},
      {"safetymode", false, [](C& c, const auto&) { return fmt::format("Safetymode: {}", name_of(c.safety_mode())); }},
      {"safetystatus", false,
       [](C& c, const auto&) { return fmt::format("Safetystatus: {}", name_of(c.safety_mode())); }},
      {"running", false, [](C& c, const auto&) { return fmt::format("Program running: {}", c.is_running()); }},
      {"programstate", false, [](C& c, const auto&) { return program_state(c); }},
      {"load", true, [](C&, const std::string& rest) { return "File not found: " + rest; }},
      {"play", true,
       [=](C& c, const auto&) { return either(c.play(), "Starting program", "Failed to execute: play"); }},
      {"stop", true, [=](C& c, const auto&) { return either(c.stop(), "Stopped", "Failed to execute: stop"); }},
      {"pause", true,
       [=](C& c, const auto&) { return either(c.pause(), "Pausing program", "Failed to execute: pause"); }},
      {"get loaded program", false, [](C&, const auto&) { return std::string("No program loaded"); }},
      {"unlock protective stop", true,
       [](C& c, const auto&) {
         if (c.safety_mode() != ur::SafetyMode::kProtectiveStop || c.unlock_protective_stop()) {
           return std::string("Protective stop releasing");
         }
         return std::string(
             "Cannot unlock protective stop until 5s after occurrence. Always inspect cause of protective stop before "
             "unlocking");
       }},
      {"close popup", false,
       [](C& c, const auto&) {
         c.close_popup();
         return std::string("closing popup");
       }},
      {"close safety popup", false,
       [](C& c, const auto&) {
         c.close_popup();
         return std::string("closing safety popup");
       }},
      {"popup", false,
       [](C& c, const std::string& rest) {
         c.show_popup(rest);
         return std::string("showing popup");
       }},
      {"addtolog", false, [](C&, const auto&) { return std::string("Added log message"); }},
      {"savelog", false, [](C&, const auto&) { return std::string("Log saved to disk"); }},
      {"restart safety", true,
       [](C& c, const auto&) {
         c.restart_safety();
         return std::string("Restarting safety");
       }},
      {"polyscopeversion", false,
       [](C& c, const auto&) {
         const auto& v = c.generation().version;
         return fmt::format("URSoftware {}.{}.{}.{} (Jan 01 2022)", v.major, v.minor, v.bugfix, v.build);
       }},
      {"get robot model", false, [](C&, const auto&) { return std::string("UR5"); }},
      {"get serial number", false, [](C&, const auto&) { return std::string("20215500000"); }},
      {"is in remote control", false,
       [](C& c, const auto&) {
         if (!c.generation().has_remote_control) return std::string("could not understand: 'is in remote control'");
         return fmt::format("{}", c.in_remote_control());
       }},
      {"isprogramsaved", false, [](C& c, const auto&) { return "true " + c.program_name(); }},
  };
  return all;
}

}  // namespace

std::string answer_dashboard(Controller& controller, std::string_view command) {
  const std::string words = lower(command);
  const Row* best = nullptr;  // the longest that fits: "close safety popup", not "close popup"
  for (const Row& row : rows()) {
    const bool fits = words == row.command || words.starts_with(fmt::format("{} ", row.command));
    if (fits && (!best || row.command.size() > best->command.size())) best = &row;
  }
  if (!best) return fmt::format("could not understand: '{}'", command);
  if (best->moves && controller.generation().has_remote_control && !controller.in_remote_control()) return kNotRemote;
  const std::size_t rest = std::min(command.size(), best->command.size() + 1);
  return best->answer(controller, std::string(command.substr(rest)));
}

Result<std::unique_ptr<net::TcpServer>> serve_dashboard(boost::asio::io_context& context, Controller& controller,
                                                        const std::string& address, std::uint16_t port) {
  const auto answer = [&controller](const std::string& line) -> net::LineService::Answer {
    if (lower(line) == "quit") return {.text = "Disconnected\n", .hangs_up = true};
    return {.text = answer_dashboard(controller, line) + "\n"};
  };
  return net::serve_lines(context, address, port, {.greeting = kBanner, .answer = answer});
}

}  // namespace jostle::robot_bridge::ur_sim
