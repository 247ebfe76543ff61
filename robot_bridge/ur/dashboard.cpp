#include "robot_bridge/ur/dashboard.hpp"

#include <array>
#include <utility>

namespace jostle::robot_bridge::ur {

Result<Dashboard> Dashboard::connect(const std::string& host, std::uint16_t port, net::Clock::time_point deadline) {
  auto tcp_result = net::TcpClient::connect(host, port, deadline);
  if (!tcp_result) return tcp_result.error();
  auto banner_result = tcp_result->read_line(deadline);
  if (!banner_result) return banner_result.error();
  return Dashboard(std::move(tcp_result).value());
}

Result<std::string> Dashboard::ask(const std::string& command, std::chrono::milliseconds patience) {
  const auto deadline = net::Clock::now() + patience;
  if (auto ok = tcp_.write(command + "\n", deadline); !ok) return ok.error();
  return tcp_.read_line(deadline);
}

Result<void> upload(const std::string& host, std::uint16_t port, const std::string& program,
                    net::Clock::time_point deadline) {
  auto tcp_result = net::TcpClient::connect(host, port, deadline);
  if (!tcp_result) return tcp_result.error();
  // The first packet says that the interface is there; a program that comes before it may be lost.
  std::array<std::uint8_t, 1024> room;
  if (auto first = tcp_result->read(room, deadline); !first) return first.error();
  return tcp_result->write(program, deadline);
}

}  // namespace jostle::robot_bridge::ur
