#pragma once
/// \file
/// The primary and secondary interfaces of a simulated controller (TCP ports 30001 and 30002): state out, programs in.

#include <list>
#include <memory>
#include <string>

#include "robot_bridge/net/lines.hpp"
#include "robot_bridge/net/tcp_server.hpp"
#include "robot_bridge/ur_sim/controller.hpp"

namespace jostle::robot_bridge::ur_sim {

/// Cuts what clients send into programs: a `def` or `sec` up to its `end` at the first column, else single lines.
class Scripts {
 public:
  void append(std::span<const std::uint8_t> bytes) { lines_.append(bytes); }
  std::optional<std::string> next();

 private:
  static constexpr std::size_t kLongest = 1 << 20;  // bytes of a program
  net::Lines lines_;
  std::string program_;  // begun
};

/// Serves one of the two interfaces to any number of clients. One thread, the io_context's.
class ScriptServer {
 public:
  /// `has_messages`: the primary interface sends messages of programs and errors, too.
  /// Error kUnavailable: the port is taken.
  static Result<std::unique_ptr<ScriptServer>> listen(boost::asio::io_context& context, Controller& controller,
                                                      const std::string& address, std::uint16_t port,
                                                      bool has_messages);

  /// Sends the state, ten times a second; once per cycle of the controller.
  void publish();
  /// Where it listens.
  std::uint16_t port() const { return server_->port(); }
  void tell(const Controller::Event& event);
  void drop_clients();

 private:
  struct Client {
    std::shared_ptr<net::Peer> peer;
    Scripts scripts;
  };

  ScriptServer(Controller& controller, bool has_messages);
  void meet(const std::shared_ptr<net::Peer>& peer);
  void obey(net::Peer& peer, const std::string& script);
  std::uint64_t time() const;  // us

  Controller& controller_;
  const bool has_messages_;
  std::unique_ptr<net::TcpServer> server_;
  std::list<Client> clients_;
  double next_ = 0.0;  // s of the controller
};

}  // namespace jostle::robot_bridge::ur_sim
