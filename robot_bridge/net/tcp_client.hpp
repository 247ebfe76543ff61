#pragma once
/// \file
/// The client's end of a TCP connection, with a deadline on everything.

#include <chrono>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "idl/types/bytes.hpp"
#include "idl/types/result.hpp"

namespace jostle::robot_bridge::net {

using Clock = std::chrono::steady_clock;

/// A TcpClient is connected, and sends what it is given at once (TCP_NODELAY).
///
/// Threads  one at a time.
/// Errors   kUnavailable  closed, refused or reset by the other side; the message begins with the place, "host:port"
///          kDeadline     the deadline passed first
class TcpClient {
 public:
  static Result<TcpClient> connect(const std::string& host, std::uint16_t port, Clock::time_point deadline);
  TcpClient(TcpClient&&) noexcept;
  TcpClient& operator=(TcpClient&&) noexcept;
  ~TcpClient();

  Result<void> write(std::span<const std::uint8_t> bytes, Clock::time_point deadline);
  Result<void> write(std::string_view text, Clock::time_point deadline);

  /// Waits for at least one byte, and returns what is there, at most as much as `room` takes: a part of `room`.
  /// After kDeadline one may read again.
  Result<std::span<const std::uint8_t>> read(std::span<std::uint8_t> room, Clock::time_point deadline);

  /// Returns the next line without its end, "\n" or "\r\n". Lines longer than 64 KiB are kInvalidArgument.
  Result<std::string> read_line(Clock::time_point deadline);

  /// Returns "host:port".
  const std::string& place() const;

 private:
  struct Impl;
  explicit TcpClient(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace jostle::robot_bridge::net
