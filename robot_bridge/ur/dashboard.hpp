#pragma once
/// \file
/// The dashboard of a controller (TCP port 29999): power, brakes, stops, programs.

#include <chrono>
#include <string>

#include "robot_bridge/net/tcp_client.hpp"

namespace jostle::robot_bridge::ur {

inline constexpr std::uint16_t kDashboardPort = 29999;

/// A Dashboard is connected.
///
/// Threads  one at a time.
/// Errors   kUnavailable, kDeadline  the controller is gone or does not answer
class Dashboard {
 public:
  static Result<Dashboard> connect(const std::string& host, std::uint16_t port, net::Clock::time_point deadline);

  /// Sends a command such as "power on", and returns its reply.
  Result<std::string> ask(const std::string& command, std::chrono::milliseconds patience = std::chrono::seconds(2));

 private:
  explicit Dashboard(net::TcpClient tcp) : tcp_(std::move(tcp)) {}
  net::TcpClient tcp_;
};

/// Sends a program to the secondary interface, and goes. That it runs is for its registers to say.
Result<void> upload(const std::string& host, std::uint16_t port, const std::string& program,
                    net::Clock::time_point deadline);

}  // namespace jostle::robot_bridge::ur
