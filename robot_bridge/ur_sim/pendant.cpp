#include "robot_bridge/ur_sim/pendant.hpp"

#include <fmt/format.h>

#include <map>

#include "robot_bridge/net/lines.hpp"

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
  return net::TcpServer::listen(context, address, port, [&controller](const std::shared_ptr<net::Peer>& peer) {
    const auto lines = std::make_shared<net::Lines>();
    peer->start({.on_bytes =
                     [&controller, lines, client = peer.get()](std::span<const std::uint8_t> bytes) {
                       lines->append(bytes);
                       while (const auto line = lines->next()) client->send(press(controller, *line) + "\n");
                     },
                 .on_end = {}});
  });
}

}  // namespace jostle::robot_bridge::ur_sim
