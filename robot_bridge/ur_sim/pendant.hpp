#pragma once
/// \file
/// What people do at a teach pendant: for tests, and to see what a system does then.

#include <memory>
#include <string>
#include <string_view>

#include "robot_bridge/net/tcp_server.hpp"
#include "robot_bridge/ur_sim/controller.hpp"

namespace jostle::robot_bridge::ur_sim {

/// Presses "protective stop", "emergency stop", "restart safety", "reboot", "remote" or "local"; returns "ok", or which
/// there are.
std::string press(Controller& controller, std::string_view button);

/// Serves it in lines of text, a reply each. One thread, the io_context's.
/// Error kUnavailable: the port is taken.
Result<std::unique_ptr<net::TcpServer>> serve_pendant(boost::asio::io_context& context, Controller& controller,
                                                      const std::string& address, std::uint16_t port);

}  // namespace jostle::robot_bridge::ur_sim
