#pragma once
/// \file
/// The server's end of TCP connections.

#include <array>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/bytes.hpp"
#include "idl/types/result.hpp"

namespace jostle::robot_bridge::net {

/// A client of a TcpServer. It is there until it closes, is closed, or stops reading: whoever leaves more than
/// kMostUnread bytes unread is disconnected.
///
/// Threads  the one that runs the io_context.
class Peer : public std::enable_shared_from_this<Peer> {
 public:
  static constexpr std::size_t kMostUnread = 1 << 20;

  /// What a server hears of a client: its bytes as they come, and its end. After on_end() nothing follows.
  struct Listener {
    std::function<void(std::span<const std::uint8_t>)> on_bytes;
    std::function<void()> on_end;
  };

  explicit Peer(boost::asio::ip::tcp::socket socket);

  /// Begins to read.
  void start(Listener listener);
  /// Sends; what is sent after close() is dropped.
  void send(std::span<const std::uint8_t> bytes);
  void send(std::string_view text);
  /// Closes at once, or after what was sent before has left.
  void close();
  void close_when_sent();
  /// Closes, and says nothing more to its listener.
  void abandon();

  bool is_open() const { return socket_.is_open(); }
  /// Returns how many bytes wait to be sent: none as long as the other side keeps up.
  std::size_t unsent() const { return sending_.size() + waiting_.size(); }

 private:
  void read();
  void write();
  void end();

  boost::asio::ip::tcp::socket socket_;
  Listener listener_;
  std::array<std::uint8_t, 4096> room_;
  Bytes sending_, waiting_;
  bool closes_when_sent_ = false;
};

/// Accepts clients at an address, as long as it lives.
class TcpServer {
 public:
  using OnPeer = std::function<void(const std::shared_ptr<Peer>&)>;

  /// Listens from now on. `port` 0: any. Error kUnavailable naming the place and the reason.
  static Result<std::unique_ptr<TcpServer>> listen(boost::asio::io_context& context, const std::string& address,
                                                   std::uint16_t port, OnPeer on_peer);
  ~TcpServer();
  TcpServer(const TcpServer&) = delete;
  TcpServer& operator=(const TcpServer&) = delete;

  std::uint16_t port() const;

 private:
  TcpServer(boost::asio::ip::tcp::acceptor acceptor, OnPeer on_peer);
  void accept();

  boost::asio::ip::tcp::acceptor acceptor_;
  OnPeer on_peer_;
  std::vector<std::weak_ptr<Peer>> peers_;
};

/// What a server of a protocol in lines says, line ends included.
struct LineService {
  struct Answer {
    std::string text;
    bool hangs_up = false;  ///< once it was sent
  };
  std::string greeting;  ///< to everybody who comes
  std::function<Answer(const std::string& line)> answer;
};

/// Serves a protocol in which each line of a client has one answer.
/// Error kUnavailable naming the place and the reason.
Result<std::unique_ptr<TcpServer>> serve_lines(boost::asio::io_context& context, const std::string& address,
                                               std::uint16_t port, LineService service);

}  // namespace jostle::robot_bridge::net
