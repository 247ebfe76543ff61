#pragma once
/// \file
/// The RTDE interface of a simulated controller (TCP port 30004).

#include <list>
#include <map>
#include <memory>
#include <string>

#include "robot_bridge/net/tcp_server.hpp"
#include "robot_bridge/ur_sim/controller.hpp"

namespace jostle::robot_bridge::ur_sim {

/// Serves RTDE, versions 1 and 2, to any number of clients. One thread, the io_context's.
class RtdeServer {
 public:
  static constexpr std::size_t kMostClients = 32;

  /// Error kUnavailable: the port is taken.
  static Result<std::unique_ptr<RtdeServer>> listen(boost::asio::io_context& context, Controller& controller,
                                                    const std::string& address, std::uint16_t port);
  ~RtdeServer();

  /// Sends a sample to everybody who is due one; once per cycle of the controller.
  void publish();
  /// Where it listens.
  std::uint16_t port() const { return server_->port(); }
  /// Sends all clients away, as a controller does that starts anew.
  void drop_clients();

 private:
  class Client;
  explicit RtdeServer(Controller& controller);
  void meet(const std::shared_ptr<net::Peer>& peer);

  Controller& controller_;
  std::unique_ptr<net::TcpServer> server_;
  std::list<std::unique_ptr<Client>> clients_;
  std::map<std::string, const Client*, std::less<>> claims_;  // inputs, by whoever writes them
};

}  // namespace jostle::robot_bridge::ur_sim
