#pragma once
/// \file
/// A viewer that means no good: WebSocket frames byte by byte, over a connection that it makes again whenever it ends.

#include <cstdint>
#include <random>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace jostle::tests {

using Bytes = std::vector<std::uint8_t>;

/// Returns a text in a frame as a client sends it: whole, and masked with `mask` (RFC 6455, 5.2).
Bytes text_frame(std::string_view text, std::uint32_t mask);

/// Threads  one.
class Attacker {
 public:
  /// Connects to a port of this host when there is something to send. `reads`: whether it takes what it is sent.
  Attacker(std::uint16_t port, bool reads) : port_(port), reads_(reads) {}
  ~Attacker() { hang_up(); }
  Attacker(const Attacker&) = delete;
  Attacker& operator=(const Attacker&) = delete;

  /// Sends bytes, as far as they are taken within a second; connects before, where there is no connection. Throws
  /// std::runtime_error where nobody answers.
  void send(std::span<const std::uint8_t> bytes);
  void hang_up();

  /// Whether a word comes in what it is sent within a minute.
  bool hears(std::string_view word);

  long connections() const { return connections_; }

 private:
  void connect();
  bool take();  // what has come; false: the connection has ended

  const std::uint16_t port_;
  const bool reads_;
  int socket_ = -1;
  long connections_ = 0;
  std::string heard_;  // the end of it
};

}  // namespace jostle::tests
