#pragma once
/// \file
/// What two doctors tell each other, apart from DDS: one JSON value per line, over TCP.

#include <nlohmann/json.hpp>

#include "services/tools/doctor/socket.hpp"

namespace jostle::tools {

/// The doctors' TCP port, next to the discovery server's.
inline constexpr int kDoctorPort = 11812;

/// A Line is one connection. What comes in is not trusted: anything that is no JSON, or too long, ends it.
class Line {
 public:
  explicit Line(Socket socket) : socket_(std::move(socket)) {}

  /// Connects to another doctor. Error kUnavailable: why not, as the system says it.
  static Result<Line> connect(in_addr address, int port, std::chrono::milliseconds patience);

  /// Waits for a message; nothing when the other side is gone, or silent until the deadline.
  std::optional<nlohmann::json> hear(TimePoint deadline, std::stop_token stop = {});
  bool say(const nlohmann::json& message);

  /// Says a question and waits for the answer. Error kUnavailable.
  Result<nlohmann::json> ask(const nlohmann::json& question);

  std::optional<in_addr> other() const;

 private:
  Socket socket_;
  std::string pending_;  // bytes after the last line
};

/// A Door is where others connect.
class Door {
 public:
  /// Opens a door. Error kUnavailable: the port is taken.
  static Result<Door> open(int port);

  /// Waits for whoever comes next; nothing after a stop request.
  std::optional<Line> next(std::stop_token stop);

 private:
  explicit Door(Socket socket) : socket_(std::move(socket)) {}

  Socket socket_;
};

}  // namespace jostle::tools
