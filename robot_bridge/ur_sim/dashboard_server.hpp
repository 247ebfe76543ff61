#pragma once
/// \file
/// The dashboard of a simulated controller (TCP port 29999): commands in lines of text, one reply each.

#include <memory>
#include <string>
#include <string_view>

#include "robot_bridge/net/tcp_server.hpp"
#include "robot_bridge/ur_sim/controller.hpp"

namespace jostle::robot_bridge::ur_sim {

/// Returns the dashboard's reply to a command, without the line's end. Commands are case-insensitive.
std::string answer_dashboard(Controller& controller, std::string_view command);

/// Serves the dashboard to any number of clients. One thread, the io_context's.
/// Error kUnavailable: the port is taken.
Result<std::unique_ptr<net::TcpServer>> serve_dashboard(boost::asio::io_context& context, Controller& controller,
                                                        const std::string& address, std::uint16_t port);

}  // namespace jostle::robot_bridge::ur_sim
