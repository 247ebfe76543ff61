#include "robot_bridge/net/tcp_server.hpp"

#include <fmt/format.h>

#include <boost/asio/buffer.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/write.hpp>
#include <utility>

#include "robot_bridge/net/lines.hpp"

namespace jostle::robot_bridge::net {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

Peer::Peer(tcp::socket socket) : socket_(std::move(socket)) {
  error_code ignored;
  socket_.set_option(tcp::no_delay(true), ignored);
}

void Peer::start(Listener listener) {
  listener_ = std::move(listener);
  read();
}

void Peer::read() {
  if (!socket_.is_open()) return;
  socket_.async_read_some(asio::buffer(room_), [self = shared_from_this()](error_code code, std::size_t count) {
    if (code) return self->end();
    if (!self->socket_.is_open()) return;
    self->listener_.on_bytes(std::span<const std::uint8_t>(self->room_).first(count));
    self->read();
  });
}

void Peer::send(std::span<const std::uint8_t> bytes) {
  if (!socket_.is_open() || closes_when_sent_) return;
  if (unsent() + bytes.size() > kMostUnread) return end();
  waiting_.insert(waiting_.end(), bytes.begin(), bytes.end());
  if (sending_.empty()) write();
}

void Peer::send(std::string_view text) {
  send(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()));
}

void Peer::write() {
  sending_.swap(waiting_);
  waiting_.clear();
  asio::async_write(socket_, asio::buffer(sending_), [self = shared_from_this()](error_code code, std::size_t) {
    self->sending_.clear();
    if (code) return self->end();
    if (!self->waiting_.empty()) return self->write();
    if (self->closes_when_sent_) self->end();
  });
}

void Peer::close_when_sent() {
  if (unsent() == 0) return end();
  closes_when_sent_ = true;
}

void Peer::close() { end(); }

void Peer::abandon() {
  listener_ = {};
  error_code ignored;
  socket_.close(ignored);
}

void Peer::end() {
  if (!socket_.is_open()) return;
  error_code ignored;
  socket_.close(ignored);
  // Not from here: whoever sends may be in the middle of its own list of peers.
  asio::post(socket_.get_executor(), [self = shared_from_this()] {
    if (self->listener_.on_end) std::exchange(self->listener_.on_end, {})();
    self->listener_ = {};
  });
}

Result<std::unique_ptr<TcpServer>> TcpServer::listen(asio::io_context& context, const std::string& address,
                                                     std::uint16_t port, OnPeer on_peer) {
  const std::string place = fmt::format("{}:{}", address, port);
  error_code code;
  const auto parsed = asio::ip::make_address_v4(address, code);
  if (code) return Error{Code::kInvalidArgument, fmt::format("address: got '{}', wanted an IPv4 address", address)};
  tcp::acceptor acceptor(context);
  acceptor.open(tcp::v4(), code);
  if (!code) acceptor.set_option(tcp::acceptor::reuse_address(true), code);
  if (!code) acceptor.bind({parsed, port}, code);
  if (!code) acceptor.listen(asio::socket_base::max_listen_connections, code);
  if (code) return Error{Code::kUnavailable, fmt::format("{}: {}", place, code.message())};
  std::unique_ptr<TcpServer> server(new TcpServer(std::move(acceptor), std::move(on_peer)));
  server->accept();
  return server;
}

TcpServer::TcpServer(tcp::acceptor acceptor, OnPeer on_peer)
    : acceptor_(std::move(acceptor)), on_peer_(std::move(on_peer)) {}

TcpServer::~TcpServer() {
  error_code ignored;
  acceptor_.close(ignored);
  for (const auto& weak : peers_) {
    if (const auto peer = weak.lock()) peer->abandon();
  }
}

void TcpServer::accept() {
  acceptor_.async_accept([this](error_code code, tcp::socket socket) {
    if (code == asio::error::operation_aborted) return;  // this server is gone
    if (!code) {
      const auto peer = std::make_shared<Peer>(std::move(socket));
      std::erase_if(peers_, [](const auto& weak) { return weak.expired(); });
      peers_.push_back(peer);
      on_peer_(peer);
    }
    accept();
  });
}

std::uint16_t TcpServer::port() const { return acceptor_.local_endpoint().port(); }

Result<std::unique_ptr<TcpServer>> serve_lines(asio::io_context& context, const std::string& address,
                                               std::uint16_t port, LineService service) {
  return TcpServer::listen(context, address, port, [service = std::move(service)](const std::shared_ptr<Peer>& peer) {
    if (!service.greeting.empty()) peer->send(service.greeting);
    const auto lines = std::make_shared<Lines>();
    const auto take = [&service, lines, client = peer.get()](std::span<const std::uint8_t> bytes) {
      lines->append(bytes);
      while (const auto line = lines->next()) {
        if (!client->is_open()) return;
        const LineService::Answer answer = service.answer(*line);
        client->send(answer.text);
        if (answer.hangs_up) return client->close_when_sent();
      }
    };
    peer->start({.on_bytes = take, .on_end = {}});
  });
}

}  // namespace jostle::robot_bridge::net
