#pragma once
/// \file
/// A viewer in C++: foxglove.websocket.v1 by Boost.Beast, call by call.

#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>
#include <cstdint>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace jostle::tests {

namespace http = boost::beast::http;
namespace websocket = boost::beast::websocket;
using boost::asio::ip::tcp;

inline const boost::asio::ip::address kLoopback = boost::asio::ip::address_v4::loopback();

inline tcp::socket connect_to(boost::asio::io_context& context, std::uint16_t port,
                              const boost::asio::ip::address& address = kLoopback) {
  tcp::socket socket(context);
  socket.connect({address, port});
  socket.set_option(tcp::no_delay(true));
  return socket;
}

using Headers = std::map<std::string, std::string>;

/// What a server answers to a request without a body.
inline http::response<http::string_body> answer_of(std::uint16_t port, const std::string& target, Headers headers = {},
                                                   http::verb verb = http::verb::get,
                                                   const boost::asio::ip::address& address = kLoopback) {
  boost::asio::io_context context;
  tcp::socket socket = connect_to(context, port, address);
  http::request<http::empty_body> request(verb, target, 11);
  headers.emplace("Host", "localhost:" + std::to_string(port));
  for (const auto& [name, value] : headers) request.set(name, value);
  http::write(socket, request);
  boost::beast::flat_buffer buffer;
  http::response<http::string_body> response;
  http::read(socket, buffer, response);
  return response;
}

/// One that asks to be a viewer.
inline Headers upgrade(Headers more = {}) {
  more.insert({{"Connection", "Upgrade"},
               {"Upgrade", "websocket"},
               {"Sec-WebSocket-Version", "13"},
               {"Sec-WebSocket-Key", "dGhlIHNhbXBsZSBub25jZQ=="},
               {"Sec-WebSocket-Protocol", "foxglove.websocket.v1"}});
  return more;
}

class ViewClient {
 public:
  struct Frame {
    bool is_text = false;
    std::string data;

    nlohmann::json json() const { return is_text ? nlohmann::json::parse(data) : nlohmann::json(); }
    std::string op() const { return is_text ? json().value("op", "") : ""; }
    bool is_sample() const { return !is_text && data.size() >= 13 && data[0] == 1; }
    bool is_time() const { return !is_text && data.size() == 9 && data[0] == 2; }
    std::uint32_t subscription() const { return at<std::uint32_t>(1); }
    std::int64_t time() const { return is_time() ? at<std::int64_t>(1) : at<std::int64_t>(5); }
    std::vector<std::byte> sample() const {
      const auto* bytes = reinterpret_cast<const std::byte*>(data.data());
      return {bytes + 13, bytes + data.size()};
    }

   private:
    template <class T>
    T at(std::size_t place) const {
      T value{};
      std::memcpy(&value, data.data() + place, sizeof value);
      return value;
    }
  };

  /// Throws boost::system::system_error where it is refused.
  explicit ViewClient(std::uint16_t port, const std::string& target = "/",
                      const boost::asio::ip::address& address = kLoopback)
      : socket_(connect_to(context_, port, address)) {
    socket_.set_option(websocket::stream_base::decorator([](websocket::request_type& request) {
      request.set(http::field::sec_websocket_protocol, "foxglove.websocket.v1");
    }));
    socket_.handshake("localhost:" + std::to_string(port), target);
  }

  void send(const nlohmann::json& request) { send_text(request.dump()); }
  void send_text(const std::string& text) {
    socket_.text(true);
    socket_.write(boost::asio::buffer(text));
  }
  void send_binary(const std::string& bytes) {
    socket_.binary(true);
    socket_.write(boost::asio::buffer(bytes));
  }

  void subscribe(std::uint32_t id, std::uint32_t channel) {
    send({{"op", "subscribe"}, {"subscriptions", {{{"id", id}, {"channelId", channel}}}}});
  }

  /// Waits for the next frame. Throws where the connection has ended.
  Frame next() {
    boost::beast::flat_buffer buffer;
    socket_.read(buffer);
    return {socket_.got_text(), boost::beast::buffers_to_string(buffer.cdata())};
  }

  /// Waits for the next one of a kind; passes over others. Throws at a complaint, which is for a request before.
  template <class Wanted>
  Frame next(const Wanted& wanted) {
    for (;;) {
      Frame frame = next();
      if (wanted(frame)) return frame;
      if (frame.op() == "status") throw std::runtime_error(frame.data);
    }
  }
  Frame next_sample() {
    return next([](const Frame& frame) { return frame.is_sample(); });
  }
  nlohmann::json next_op(const std::string& op) {
    return next([&](const Frame& frame) { return frame.op() == op; }).json();
  }

  /// Waits until a topic is advertised; returns its channel.
  nlohmann::json channel(const std::string& topic) {
    for (;;) {
      const nlohmann::json advertisement = next_op("advertise");
      for (const nlohmann::json& one : advertisement["channels"]) {
        if (one["topic"] == topic) return one;
      }
    }
  }

 private:
  boost::asio::io_context context_;
  websocket::stream<tcp::socket> socket_;
};

}  // namespace jostle::tests
