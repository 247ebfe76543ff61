#include "services/tools/doctor/network.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <unistd.h>

#include <fstream>
#include <string>

#include "services/common/process/domain.hpp"
#include "services/common/process/environment.hpp"
#include "services/tools/doctor/socket.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/profiles.hpp"

namespace jostle::tools {
namespace {

constexpr std::chrono::milliseconds kPatience{500};  // loopback takes microseconds

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

struct Addresses {
  bool loopback = false;  // 127.0.0.1, of an interface that is up
  bool has_ipv6 = false;  // beside the loopback
  std::vector<std::string> others;
};

Addresses addresses() {
  Addresses result;
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return result;
  for (const ifaddrs* one = all; one; one = one->ifa_next) {
    if (!one->ifa_addr || !(one->ifa_flags & IFF_UP)) continue;
    const bool is_loopback = one->ifa_flags & IFF_LOOPBACK;
    if (one->ifa_addr->sa_family == AF_INET6 && !is_loopback) result.has_ipv6 = true;
    if (one->ifa_addr->sa_family != AF_INET) continue;
    const std::string text = to_string(reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr);
    if (text == "127.0.0.1") result.loopback = true;
    if (!is_loopback) result.others.push_back(fmt::format("{} ({})", text, one->ifa_name));
  }
  freeifaddrs(all);
  return result;
}

// Sends a datagram to the group through one interface and waits for it there.
Result<void> send_and_receive(in_addr interface) {
  const auto ear_result = Ear::open(0, interface);
  if (!ear_result) return ear_result.error();
  const std::string text = fmt::format("jostle doctor {}", getpid());
  if (auto ok = send_datagram(text, {inet_addr(kGroup)}, ear_result->port(), interface); !ok) return ok;
  if (ear_result->hears(text, std::chrono::steady_clock::now() + kPatience)) return {};
  return Error{Code::kUnavailable, fmt::format("sent, not received within {} ms", kPatience.count())};
}

Check check_interface(const std::string& name, in_addr address) {
  Check check{.name = "multicast " + name};
  const auto ok = send_and_receive(address);
  if (ok) {
    check.finding = fmt::format("a datagram to {} came back", kGroup);
    return check;
  }
  check.verdict = Verdict::kFail;
  check.finding = fmt::format("{}: {}", kGroup, ok.error().message);
  check.remedy = fmt::format(
      "ip link set {} multicast on, and let a firewall pass UDP to {}; or "
      "--discovery peers:HOST,HOST,...",
      name, kGroup);
  return check;
}

}  // namespace

Check check_addresses() {
  const Addresses found = addresses();
  const std::string name = "IPv4";
  if (!found.loopback) {
    return {name, Verdict::kFail,
            fmt::format("no 127.0.0.1: processes of this machine do not hear each other{}",
                        found.others.empty() ? "; no other IPv4 address either" : ""),
            "ip link set lo up; ip address add 127.0.0.1/8 dev lo"};
  }
  if (!found.others.empty())
    return {name, Verdict::kOk, fmt::format("127.0.0.1, {}", fmt::join(found.others, ", ")), ""};
  return {name, Verdict::kWarn,
          fmt::format("127.0.0.1 only{}: no other machine is reachable",
                      found.has_ipv6 ? ", beside IPv6, which Jostle does not use" : ""),
          "if there are others: an IPv4 address on their network, ip address add ADDRESS/24 dev INTERFACE"};
}

bool finds_by_multicast() {
  const auto choice_result = common::choose_network();
  return !choice_result || choice_result->discovery.starts_with("multicast");
}

std::vector<Check> check_multicast() {
  std::vector<Check> checks{check_interface("lo", {htonl(INADDR_LOOPBACK)})};
  const auto address = route_to({inet_addr(kGroup)});
  if (!address) {
    checks.push_back({"multicast route", Verdict::kWarn,
                      fmt::format("none to {}: only this machine is reachable", kGroup),
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
  const long wanted = wire::socket_buffer();
  check.finding = fmt::format("net.core.rmem_max {} bytes, wanted at least {}", bytes, wanted);
  if (bytes < wanted) {
    check.verdict = Verdict::kWarn;
    check.remedy = fmt::format("sysctl -w net.core.rmem_max={}; keep it in /etc/sysctl.d/60-jostle.conf", wanted);
  }
  return check;
}

Check check_profiles() {
  const auto file = wire::profiles_file();
  if (file.path.empty()) return {"profiles", Verdict::kOk, "no file: transports and QoS as in the code", ""};
  const auto ok = wire::load_profiles(file);
  if (ok) return {"profiles", Verdict::kOk, file.path.string(), ""};
  return {"profiles", Verdict::kFail, ok.error().message, "put that right; no program starts with it"};
}

Check check_domain(std::optional<int> wanted) {
  const auto domain_result = common::choose_domain(wanted);
  if (!domain_result) return {"domain", Verdict::kFail, domain_result.error().message, "export ROS_DOMAIN_ID=0"};
  const auto trouble = common::port_trouble(*domain_result);
  if (!trouble) return {"domain", Verdict::kOk, fmt::format("{}", *domain_result), ""};
  return {"domain", Verdict::kWarn, fmt::format("{}: {}", *domain_result, trouble->finding), trouble->remedy};
}

}  // namespace jostle::tools
