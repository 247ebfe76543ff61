#include "tests/fuzz/view/attacker.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <stdexcept>

namespace jostle::tests {
namespace {

constexpr std::size_t kMostKept = 64 << 10;  // bytes of what was heard
constexpr int kPatience = 1000;              // ms, for the server to take something
constexpr int kAnswered = 2;                 // ms: most frames have an answer, and sooner
constexpr std::chrono::seconds kAnswer{60};

constexpr std::string_view kUpgrade =
    "GET / HTTP/1.1\r\nHost: localhost\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
    "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n"
    "Sec-WebSocket-Protocol: foxglove.websocket.v1\r\n\r\n";

}  // namespace

Bytes text_frame(std::string_view text, std::uint32_t mask) {
  Bytes frame{0x81};
  if (text.size() < 126) {
    frame.push_back(static_cast<std::uint8_t>(0x80 | text.size()));
  } else {
    const int width = text.size() < (1 << 16) ? 2 : 8;
    frame.push_back(width == 2 ? 0xfe : 0xff);
    for (int i = width - 1; i >= 0; --i) frame.push_back(static_cast<std::uint8_t>(text.size() >> (8 * i)));
  }
  std::array<std::uint8_t, 4> key{};
  for (std::size_t i = 0; i < key.size(); ++i) frame.push_back(key[i] = static_cast<std::uint8_t>(mask >> (8 * i)));
  for (std::size_t i = 0; i < text.size(); ++i) frame.push_back(static_cast<std::uint8_t>(text[i]) ^ key[i % 4]);
  return frame;
}

void Attacker::connect() {
  socket_ = socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in server{};
  server.sin_family = AF_INET;
  server.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  server.sin_port = htons(port_);
  if (::connect(socket_, reinterpret_cast<const sockaddr*>(&server), sizeof server) != 0)
    throw std::runtime_error("the server takes no connection");
  const int on = 1;
  setsockopt(socket_, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
  heard_.clear();
  ++connections_;
  const timeval patience{.tv_sec = kAnswer.count(), .tv_usec = 0};
  setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
  if (::send(socket_, kUpgrade.data(), kUpgrade.size(), MSG_NOSIGNAL) < 0) return hang_up();
  // No frame goes out before the server has agreed.
  for (std::array<char, 1024> bytes; heard_.find("\r\n\r\n") == std::string::npos;) {
    const ssize_t count = recv(socket_, bytes.data(), bytes.size(), 0);
    if (count <= 0) return hang_up();
    heard_.append(bytes.data(), static_cast<std::size_t>(count));
  }
  fcntl(socket_, F_SETFL, O_NONBLOCK);
}

void Attacker::hang_up() {
  if (socket_ < 0) return;
  // What was sent is read before the end, unless the server has closed: a socket with something unread would reset it.
  shutdown(socket_, SHUT_WR);
  pollfd one{.fd = socket_, .events = POLLIN, .revents = 0};
  while (reads_ && take() && poll(&one, 1, kPatience) > 0) {
  }
  close(socket_);
  socket_ = -1;
}

bool Attacker::take() {
  std::array<char, 16384> bytes;
  for (;;) {
    const ssize_t count = recv(socket_, bytes.data(), bytes.size(), 0);
    if (count == 0) return false;
    if (count < 0) return errno == EAGAIN || errno == EWOULDBLOCK;
    heard_.append(bytes.data(), static_cast<std::size_t>(count));
    if (heard_.size() > kMostKept) heard_.erase(0, heard_.size() - kMostKept);
  }
}

void Attacker::send(std::span<const std::uint8_t> bytes) {
  if (socket_ < 0) connect();
  while (!bytes.empty() && socket_ >= 0) {
    if (reads_ && !take()) return hang_up();
    const ssize_t count = ::send(socket_, bytes.data(), bytes.size(), MSG_NOSIGNAL);
    if (count > 0) {
      bytes = bytes.subspan(static_cast<std::size_t>(count));
      continue;
    }
    if (errno != EAGAIN && errno != EWOULDBLOCK) return hang_up();
    pollfd one{.fd = socket_, .events = static_cast<short>(POLLOUT | (reads_ ? POLLIN : 0)), .revents = 0};
    if (poll(&one, 1, kPatience) <= 0) return;
  }
  // Who sends far ahead sends to a connection that an earlier frame has ended.
  pollfd one{.fd = socket_, .events = POLLIN, .revents = 0};
  if (reads_ && socket_ >= 0 && poll(&one, 1, kAnswered) > 0 && !take()) hang_up();
}

bool Attacker::hears(std::string_view word) {
  const auto deadline = std::chrono::steady_clock::now() + kAnswer;
  while (socket_ >= 0 && std::chrono::steady_clock::now() < deadline) {
    const bool goes_on = take();
    if (heard_.find(word) != std::string::npos) return true;
    if (!goes_on) break;
    pollfd one{.fd = socket_, .events = POLLIN, .revents = 0};
    poll(&one, 1, kPatience);
  }
  return false;
}

}  // namespace jostle::tests
