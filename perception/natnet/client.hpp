#pragma once
/// \file
/// The client's end of NatNet: where motion capture sees rigid bodies.

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "perception/natnet/messages.hpp"

namespace jostle::perception::natnet {

/// A rigid body, by the name it has in the motion capture's own program.
struct NamedBody {
  std::string name;
  Body body;
};

/// What was seen at one moment.
struct Seen {
  std::int32_t frame = 0;
  std::chrono::system_clock::time_point exposed;  ///< by this host's clock, as the echoes say
  double timestamp = 0.0;                         ///< s of the server's own time
  std::vector<NamedBody> bodies;
};

/// A Client finds a server, keeps it sending, learns the names of its bodies and how its clock goes, and hands over
/// every frame. A server that is gone is looked for until it is back.
///
/// Threads  one of its own, which calls on_seen; everything else from any thread.
class Client {
 public:
  struct Options {
    std::string host = "127.0.0.1";  ///< IPv4 address or name of the server
    std::uint16_t command_port = kCommandPort;
    /// IPv4 address of this host's interface on which multicast is heard; empty: the system's choice.
    std::string interface;
    /// What the server is asked to speak; nothing: what it does. Only servers that send unicast do as they are asked.
    std::optional<Version> version;
  };
  struct Counts {
    std::uint64_t frames = 0;
    std::uint64_t lost = 0;       ///< by the numbers of frames
    std::uint64_t malformed = 0;  ///< messages that were dropped
    double round_trip = 0.0;      ///< s, the smallest of the newest echoes; 0: none yet
  };

  /// Error kUnavailable: no socket, or the host has no address.
  static Result<std::unique_ptr<Client>> start(Options options, std::function<void(const Seen&)> on_seen);
  ~Client();

  /// Says what is wrong; "" if frames come.
  std::string trouble() const;
  Counts counts() const;

 private:
  class Impl;
  explicit Client(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace jostle::perception::natnet
