#pragma once
/// \file
/// What two doctors tell each other, apart from DDS: one JSON value per line, over TCP.

#include <nlohmann/json.hpp>

#include "services/tools/doctor/socket.hpp"

namespace jostle::tools {

/// Beside the discovery server's.
inline constexpr int kDoctorPort = 11812;

/// One connection. Whatever comes in is somebody else's: what is no JSON, or too long, ends it.
class Line {
 public:
  explicit Line(Socket socket) : socket_(std::move(socket)) {}

  /// Error kUnavailable: why not, as the system says it.
  static Result<Line> connect(in_addr address, int port, std::chrono::milliseconds patience);

  /// Nothing when the other side is gone or silent until the deadline.
  std::optional<nlohmann::json> hear(TimePoint deadline, std::stop_token stop = {});
  bool say(const nlohmann::json& message);

  /// Question and answer. Error kUnavailable.
  Result<nlohmann::json> ask(const nlohmann::json& question);

  std::optional<in_addr> other() const;

 private:
  Socket socket_;
  std::string pending_;  // bytes after the last line
};

/// Where others connect.
class Door {
 public:
  /// Error kUnavailable: the port is taken.
  static Result<Door> open(int port);

  /// Whoever comes next; nothing after a stop request.
  std::optional<Line> next(std::stop_token stop);

 private:
  explicit Door(Socket socket) : socket_(std::move(socket)) {}

  Socket socket_;
};

}  // namespace jostle::tools
