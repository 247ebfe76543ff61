#include "robot_bridge/net/tcp_client.hpp"

#include <fmt/format.h>

#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/write.hpp>
#include <optional>
#include <utility>

#include "robot_bridge/net/lines.hpp"

namespace jostle::robot_bridge::net {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using boost::system::error_code;

constexpr std::size_t kLongestLine = 1 << 16;  // bytes

}  // namespace

struct TcpClient::Impl {
  asio::io_context context{1};
  tcp::socket socket{context};
  std::string place;
  Lines lines;  // of read_line()

  // Runs one operation that `begin` started with a handler to be called, until it is done or its time is over.
  template <class Begin>
  Result<std::size_t> perform(const char* what, Clock::time_point deadline, const Begin& begin) {
    std::optional<std::pair<error_code, std::size_t>> done;
    begin([&](error_code code, std::size_t count) { done.emplace(code, count); });
    context.restart();
    while (!done && context.run_one_until(deadline) > 0) continue;
    const bool late = !done;
    if (late) {
      error_code ignored;
      socket.cancel(ignored);
      context.restart();
      context.run();  // the handler is called in any case
    }
    if (!done->first) return done->second;
    if (late) return Error{Code::kDeadline, fmt::format("{}: {} took too long", place, what)};
    return Error{Code::kUnavailable, fmt::format("{}: {}: {}", place, what, done->first.message())};
  }
};

TcpClient::TcpClient(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
TcpClient::TcpClient(TcpClient&&) noexcept = default;
TcpClient& TcpClient::operator=(TcpClient&&) noexcept = default;
TcpClient::~TcpClient() = default;

Result<TcpClient> TcpClient::connect(const std::string& host, std::uint16_t port, Clock::time_point deadline) {
  auto impl = std::make_unique<Impl>();
  impl->place = fmt::format("{}:{}", host, port);
  error_code code;
  const auto places = tcp::resolver(impl->context).resolve(tcp::v4(), host, std::to_string(port), code);
  if (code) return Error{Code::kUnavailable, fmt::format("{}: {}", impl->place, code.message())};
  auto connected = impl->perform("connecting", deadline, [&](auto done) {
    asio::async_connect(impl->socket, places, [done](error_code result, const tcp::endpoint&) { done(result, 0); });
  });
  if (!connected) return connected.error();
  impl->socket.set_option(tcp::no_delay(true), code);
  return TcpClient(std::move(impl));
}

Result<void> TcpClient::write(std::span<const std::uint8_t> bytes, Clock::time_point deadline) {
  auto written = impl_->perform("writing", deadline, [&](auto done) {
    asio::async_write(impl_->socket, asio::buffer(bytes.data(), bytes.size()), done);
  });
  if (!written) return written.error();
  return {};
}

Result<void> TcpClient::write(std::string_view text, Clock::time_point deadline) {
  return write(std::span(reinterpret_cast<const std::uint8_t*>(text.data()), text.size()), deadline);
}

Result<std::span<const std::uint8_t>> TcpClient::read(std::span<std::uint8_t> room, Clock::time_point deadline) {
  auto count_result = impl_->perform("reading", deadline, [&](auto done) {
    impl_->socket.async_read_some(asio::buffer(room.data(), room.size()), done);
  });
  if (!count_result) return count_result.error();
  return std::span<const std::uint8_t>(room.first(*count_result));
}

Result<std::string> TcpClient::read_line(Clock::time_point deadline) {
  std::array<std::uint8_t, 1024> room;
  for (;;) {
    if (auto line = impl_->lines.next()) return *std::move(line);
    if (impl_->lines.waiting() > kLongestLine) {
      return Error{Code::kInvalidArgument,
                   fmt::format("{}: got a line of more than {} bytes, wanted its end", impl_->place, kLongestLine)};
    }
    auto bytes_result = read(room, deadline);
    if (!bytes_result) return bytes_result.error();
    impl_->lines.append(*bytes_result);
  }
}

const std::string& TcpClient::place() const { return impl_->place; }

}  // namespace jostle::robot_bridge::net
