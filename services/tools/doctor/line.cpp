#include "services/tools/doctor/line.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "idl/text/json.hpp"

namespace jostle::tools {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t kLongestLine = 1 << 16;  // bytes
constexpr std::chrono::seconds kAnswer{15};    // the other doctor looks at its own machine first

}  // namespace

Result<Line> Line::connect(in_addr address, int port, std::chrono::milliseconds patience) {
  Socket socket(SOCK_STREAM);
  const auto failed = [](int code) { return Error{Code::kUnavailable, std::strerror(code)}; };
  const int flags = fcntl(socket.get(), F_GETFL);
  fcntl(socket.get(), F_SETFL, flags | O_NONBLOCK);
  const sockaddr_in there = endpoint(address, port);
  if (::connect(socket.get(), generic(there), sizeof there) != 0 && errno != EINPROGRESS) return failed(errno);
  pollfd waiting{.fd = socket.get(), .events = POLLOUT, .revents = 0};
  if (poll(&waiting, 1, static_cast<int>(patience.count())) <= 0) return failed(ETIMEDOUT);
  int code = 0;
  socklen_t size = sizeof code;
  getsockopt(socket.get(), SOL_SOCKET, SO_ERROR, &code, &size);
  if (code != 0) return failed(code);
  fcntl(socket.get(), F_SETFL, flags);
  return Line(std::move(socket));
}

std::optional<nlohmann::json> Line::hear(TimePoint deadline, std::stop_token stop) {
  std::size_t end;
  while ((end = pending_.find('\n')) == std::string::npos) {
    char buffer[4096];
    if (pending_.size() > kLongestLine || !socket_.readable(deadline, stop)) return {};
    const ssize_t size = recv(socket_.get(), buffer, sizeof buffer, 0);
    if (size <= 0) return {};
    pending_.append(buffer, static_cast<std::size_t>(size));
  }
  auto message_result = parse_json(std::string_view(pending_).substr(0, end));
  pending_.erase(0, end + 1);
  if (!message_result || !message_result->is_object()) return {};
  return std::move(message_result).value();
}

bool Line::say(const nlohmann::json& message) {
  // Names of hosts and files may hold anything.
  const std::string text = message.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
  return send(socket_.get(), text.data(), text.size(), MSG_NOSIGNAL) == static_cast<ssize_t>(text.size());
}

Result<nlohmann::json> Line::ask(const nlohmann::json& question) {
  if (say(question)) {
    if (auto answer = hear(Clock::now() + kAnswer)) return *std::move(answer);
  }
  return Error{Code::kUnavailable, "the other doctor went silent"};
}

std::optional<in_addr> Line::other() const {
  sockaddr_in address{};
  socklen_t size = sizeof address;
  if (getpeername(socket_.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0) return {};
  return address.sin_addr;
}

Result<Door> Door::open(int port) {
  Socket socket(SOCK_STREAM);
  const int yes = 1;
  setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  const sockaddr_in here = endpoint(any_address(), port);
  if (bind(socket.get(), generic(here), sizeof here) != 0 || listen(socket.get(), 1) != 0) {
    return Error{Code::kUnavailable,
                 fmt::format("TCP port {}: {}; wanted a free one, see --port", port, std::strerror(errno))};
  }
  return Door(std::move(socket));
}

std::optional<Line> Door::next(std::stop_token stop) {
  while (!stop.stop_requested()) {
    if (!socket_.readable(TimePoint::max() - std::chrono::hours(1), stop)) continue;
    const int descriptor = accept4(socket_.get(), nullptr, nullptr, SOCK_CLOEXEC);
    if (descriptor >= 0) return Line(Socket::adopt(descriptor));
  }
  return {};
}

}  // namespace jostle::tools
