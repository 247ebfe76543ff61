#include "services/tools/doctor/socket.hpp"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <vector>

#include "services/common/process/domain.hpp"

namespace jostle::tools {
namespace {

constexpr std::chrono::milliseconds kGlance{50};  // between two looks at a stop request
constexpr int kParticipants = 120;                // of a host and domain: then the ports are another domain's
constexpr std::size_t kLargestDatagram = 1 << 16;

}  // namespace

Socket::Socket(int type) : descriptor_(socket(AF_INET, type | SOCK_CLOEXEC, 0)) {}

Socket::~Socket() {
  if (descriptor_ >= 0) close(descriptor_);
}

bool Socket::readable(TimePoint deadline, std::stop_token stop) const {
  pollfd waiting{.fd = descriptor_, .events = POLLIN, .revents = 0};
  while (!stop.stop_requested()) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - std::chrono::steady_clock::now());
    if (left.count() < 0) return false;
    if (poll(&waiting, 1, static_cast<int>(std::min(left, kGlance).count())) > 0) return true;
  }
  return false;
}

sockaddr_in endpoint(in_addr address, int port) {
  sockaddr_in result{};
  result.sin_family = AF_INET;
  result.sin_addr = address;
  result.sin_port = htons(static_cast<in_port_t>(port));
  return result;
}

const sockaddr* generic(const sockaddr_in& address) { return reinterpret_cast<const sockaddr*>(&address); }

std::optional<sockaddr_in> own_endpoint(const Socket& socket) {
  sockaddr_in address{};
  socklen_t size = sizeof address;
  if (getsockname(socket.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0) return {};
  return address;
}

std::string to_string(in_addr address) {
  char text[INET_ADDRSTRLEN] = "";
  inet_ntop(AF_INET, &address, text, sizeof text);
  return text;
}

std::optional<in_addr> route_to(in_addr other) {
  const Socket probe(SOCK_DGRAM);
  const sockaddr_in there = endpoint(other, 7400);
  if (connect(probe.get(), generic(there), sizeof there) != 0) return {};
  const auto own = own_endpoint(probe);
  return own ? std::optional(own->sin_addr) : std::nullopt;
}

std::string failed_step(const std::string& step) { return step + ": " + std::strerror(errno); }

Result<Ear> Ear::open(int port, std::optional<in_addr> group_through) {
  Socket socket(SOCK_DGRAM);
  const int yes = 1;
  // Participants of this host have the domain's multicast port, too; unicast ports are one's own.
  if (group_through) setsockopt(socket.get(), SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  const sockaddr_in here = endpoint(any_address(), port);
  if (bind(socket.get(), generic(here), sizeof here) != 0) return Error{Code::kIo, failed_step("bind")};
  if (group_through) {
    const ip_mreq membership{.imr_multiaddr = {inet_addr(kGroup)}, .imr_interface = *group_through};
    if (setsockopt(socket.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership) != 0) {
      return Error{Code::kIo, failed_step("joining the group")};
    }
  }
  const auto own = own_endpoint(socket);
  if (!own) return Error{Code::kIo, failed_step("getsockname")};
  return Ear(std::move(socket), ntohs(own->sin_port));
}

Result<Ear> Ear::open_in_domain(int domain) {
  for (int participant = 0;; ++participant) {
    auto ear_result = open(common::unicast_port(domain, participant));
    if (ear_result || participant == kParticipants) return ear_result;
  }
}

bool Ear::hears(const std::string& datagram, TimePoint deadline) const {
  std::vector<char> buffer(kLargestDatagram);
  while (socket_.readable(deadline)) {
    const ssize_t size = recv(socket_.get(), buffer.data(), buffer.size(), 0);
    if (size > 0 && std::string_view(buffer.data(), static_cast<std::size_t>(size)) == datagram) return true;
  }
  return false;
}

Result<void> send_datagram(const std::string& datagram, in_addr to, int port, std::optional<in_addr> through) {
  const Socket socket(SOCK_DGRAM);
  if (through && setsockopt(socket.get(), IPPROTO_IP, IP_MULTICAST_IF, &*through, sizeof *through) != 0) {
    return Error{Code::kIo, failed_step("choosing the interface")};
  }
  const sockaddr_in there = endpoint(to, port);
  if (sendto(socket.get(), datagram.data(), datagram.size(), 0, generic(there), sizeof there) < 0) {
    return Error{Code::kIo, failed_step("sending")};
  }
  return {};
}

}  // namespace jostle::tools
