#include "robot_bridge/ur_sim/pendant.hpp"

#include <fmt/format.h>

#include <map>

namespace jostle::robot_bridge::ur_sim {

std::string press(Controller& controller, std::string_view button) {
  using Press = void (*)(Controller&);
  static const std::map<std::string_view, Press> kButtons{
      {"protective stop", [](Controller& c) { c.protective_stop("pressed on the pendant"); }},
      {"emergency stop", [](Controller& c) { c.emergency_stop(); }},
      {"restart safety", [](Controller& c) { c.restart_safety(); }},
      {"reboot", [](Controller& c) { c.reboot(); }},
      {"remote", [](Controller& c) { c.set_remote_control(true); }},
      {"local", [](Controller& c) { c.set_remote_control(false); }}};
  if (const auto found = kButtons.find(button); found != kButtons.end()) {
    found->second(controller);
    return "ok";
  }
  std::string known;
  for (const auto& [name, press] : kButtons) known += fmt::format("{}{}", known.empty() ? "" : ", ", name);
  return fmt::format("got '{}', wanted {}", button, known);
}

Result<std::unique_ptr<net::TcpServer>> serve_pendant(boost::asio::io_context& context, Controller& controller,
                                                      const std::string& address, std::uint16_t port) {
  const auto answer = [&controller](const std::string& line) -> net::LineService::Answer {
    return {.text = press(controller, line) + "\n"};
  };
  return net::serve_lines(context, address, port, {.greeting = "", .answer = answer});
}

}  // namespace jostle::robot_bridge::ur_sim
