#pragma once
/// \file
/// The server's end of NatNet: a motion capture that is simulated.

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "perception/natnet/messages.hpp"

namespace jostle::perception::natnet {

/// A Server tells whoever connects where rigid bodies are.
///
/// It sends to the addresses its clients connected from, or to a multicast group; a client that sent nothing for 10 s
/// is forgotten. Each client of unicast has the version it asked for.
///
/// Threads  one of its own; everything from any thread.
class Server {
 public:
  struct Options {
    std::string address = "127.0.0.1";  ///< IPv4, to listen at
    std::uint16_t command_port = kCommandPort;
    Version version;  ///< of frames, unless a client asks for another
    float frame_rate = 120.0F;
    bool multicast = false;
    std::string group = kGroup;
    std::uint16_t data_port = kDataPort;
  };
  static constexpr std::uint64_t kClock = 10'000'000;  ///< ticks/s
  static constexpr std::size_t kMostClients = 64;

  /// Error kUnavailable: the port is taken; names it.
  static Result<std::unique_ptr<Server>> listen(Options options, std::vector<Model> models);
  ~Server();

  /// Sends a frame that was exposed now; its number and ticks are the server's. `latency`: it is sent so much later,
  /// after those that are sent meanwhile.
  void publish(Frame frame, std::chrono::nanoseconds latency = {});
  std::size_t clients() const;

 private:
  class Impl;
  explicit Server(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace jostle::perception::natnet
