#include "services/doctor/network.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <optional>
#include <string_view>

namespace jostle::services {
namespace {

constexpr const char* kGroup = "239.255.0.1";  // RTPS 2.2, Sec. 9.6.1.4: default discovery group
constexpr long kBufferBytes = 4 << 20;         // 1 MiB samples: p99 68 ms with 208 KiB, 6 ms with 4 MiB
constexpr int kPatience = 500;                 // ms; loopback takes microseconds
constexpr int kLastDomain = 232;               // RTPS 2.2, Sec. 9.6.1.1: ports end at 65535

class Socket {
 public:
  Socket() : descriptor_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {}
  ~Socket() {
    if (descriptor_ >= 0) close(descriptor_);
  }
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;

  int get() const { return descriptor_; }

 private:
  int descriptor_;
};

sockaddr_in endpoint(in_addr_t address, in_port_t port_in_network_order) {
  sockaddr_in result{};
  result.sin_family = AF_INET;
  result.sin_addr.s_addr = address;
  result.sin_port = port_in_network_order;
  return result;
}

const sockaddr* generic(const sockaddr_in& address) { return reinterpret_cast<const sockaddr*>(&address); }

std::optional<sockaddr_in> own_endpoint(const Socket& socket) {
  sockaddr_in address{};
  socklen_t size = sizeof address;
  if (getsockname(socket.get(), reinterpret_cast<sockaddr*>(&address), &size) != 0) return {};
  return address;
}

// The address datagrams to the group would leave from, by the kernel's routes.
std::optional<in_addr> route_to_group() {
  const Socket probe;
  const sockaddr_in group = endpoint(inet_addr(kGroup), htons(7400));
  if (connect(probe.get(), generic(group), sizeof group) != 0) return {};
  const auto own = own_endpoint(probe);
  return own ? std::optional(own->sin_addr) : std::nullopt;
}

std::string interface_with(in_addr address) {
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return "?";
  std::string name = "?";
  for (const ifaddrs* one = all; one != nullptr; one = one->ifa_next) {
    if (one->ifa_addr == nullptr || one->ifa_addr->sa_family != AF_INET) continue;
    if (reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr.s_addr == address.s_addr) {
      name = one->ifa_name;
    }
  }
  freeifaddrs(all);
  return name;
}

bool wait_for(const Socket& socket, std::string_view wanted) {
  pollfd waiting{.fd = socket.get(), .events = POLLIN, .revents = 0};
  char text[64];
  while (poll(&waiting, 1, kPatience) > 0) {
    const ssize_t size = recv(socket.get(), text, sizeof text, 0);
    if (size > 0 && std::string_view(text, static_cast<std::size_t>(size)) == wanted) return true;
  }
  return false;
}

// Sends a datagram to the group through one interface and waits for it there.
// Returns "" or the step that failed.
std::string send_and_receive(in_addr interface) {
  const Socket receiver, sender;
  const sockaddr_in any = endpoint(htonl(INADDR_ANY), 0);
  if (bind(receiver.get(), generic(any), sizeof any) != 0) return "bind: " + std::string(std::strerror(errno));
  const ip_mreq membership{.imr_multiaddr = {inet_addr(kGroup)}, .imr_interface = interface};
  if (setsockopt(receiver.get(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership) != 0) {
    return "joining the group: " + std::string(std::strerror(errno));
  }
  if (setsockopt(sender.get(), IPPROTO_IP, IP_MULTICAST_IF, &interface, sizeof interface) != 0) {
    return "choosing the interface: " + std::string(std::strerror(errno));
  }
  const auto own = own_endpoint(receiver);
  if (!own) return "getsockname: " + std::string(std::strerror(errno));
  const sockaddr_in group = endpoint(inet_addr(kGroup), own->sin_port);
  const std::string text = fmt::format("jostle doctor {}", getpid());
  if (sendto(sender.get(), text.data(), text.size(), 0, generic(group), sizeof group) < 0) {
    return "sending: " + std::string(std::strerror(errno));
  }
  return wait_for(receiver, text) ? "" : fmt::format("sent, not received within {} ms", kPatience);
}

Check check_interface(const std::string& name, in_addr address) {
  Check check{.name = "multicast " + name};
  const std::string problem = send_and_receive(address);
  if (problem.empty()) {
    check.finding = fmt::format("a datagram to {} came back", kGroup);
    return check;
  }
  check.verdict = Verdict::kFail;
  check.finding = fmt::format("{}: {}", kGroup, problem);
  check.remedy = fmt::format("ip link set {} multicast on, and let a firewall pass UDP to {}; or "
                             "list the peers' addresses instead of multicast", name, kGroup);
  return check;
}

}  // namespace

std::vector<Check> check_multicast() {
  std::vector<Check> checks{check_interface("lo", {htonl(INADDR_LOOPBACK)})};
  const auto address = route_to_group();
  if (!address) {
    checks.push_back({"multicast route", Verdict::kWarn, fmt::format("none to {}: only this machine is reachable", kGroup),
                      "ip route add 239.0.0.0/8 dev INTERFACE"});
    return checks;
  }
  const std::string name = interface_with(*address);
  checks.push_back({"multicast route", Verdict::kOk, fmt::format("{} leaves through {}", kGroup, name), ""});
  if (name != "lo") checks.push_back(check_interface(name, *address));
  return checks;
}

Check check_udp_buffers() {
  Check check{.name = "UDP buffers"};
  long bytes = 0;
  if (!(std::ifstream("/proc/sys/net/core/rmem_max") >> bytes)) {
    return {check.name, Verdict::kWarn, "net.core.rmem_max cannot be read here", "look at it on the host"};
  }
  check.finding = fmt::format("net.core.rmem_max {} bytes, wanted at least {}", bytes, kBufferBytes);
  if (bytes < kBufferBytes) {
    check.verdict = Verdict::kWarn;
    check.remedy = fmt::format("sysctl -w net.core.rmem_max={}; keep it in /etc/sysctl.d/60-jostle.conf",
                               kBufferBytes);
  }
  return check;
}

Check check_domain() {
  const char* variable = std::getenv("ROS_DOMAIN_ID");
  const std::string_view text = variable == nullptr ? "" : variable;
  if (text.empty()) return {"domain", Verdict::kOk, "ROS_DOMAIN_ID is not set: domain 0", ""};
  int domain = -1;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), domain);
  if (problem == std::errc{} && end == text.data() + text.size() && domain >= 0 && domain <= kLastDomain) {
    return {"domain", Verdict::kOk, fmt::format("ROS_DOMAIN_ID {}", domain), ""};
  }
  return {"domain", Verdict::kFail, fmt::format("ROS_DOMAIN_ID: got '{}', wanted 0 to {}", text, kLastDomain),
          "export ROS_DOMAIN_ID=0"};
}

}  // namespace jostle::services
