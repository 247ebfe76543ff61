#include "services/common/process/domain.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <sstream>

#include "idl/types/number.hpp"

namespace jostle::common {
namespace {

constexpr int kLargestDomain = 232;  // RTPS 2.2, 9.6.1.1: ports would pass 65535 beyond

// Whether all ports from `first` to `last` are in net.ipv4.ip_local_reserved_ports, which reads like "8080,9148-9150":
// the kernel gives these to nobody.
bool all_reserved(int first, int last) {
  std::ifstream in("/proc/sys/net/ipv4/ip_local_reserved_ports");
  int next = first;  // lists are sorted
  for (std::string range; next <= last && std::getline(in, range, ',');) {
    int begin = 0, end = 0;
    std::istringstream words(range);
    if (!(words >> begin)) continue;
    end = begin;
    if (words.get() == '-') words >> end;
    if (begin <= next && next <= end) next = end + 1;
  }
  return next > last;
}

}  // namespace

Result<int> choose_domain(std::optional<int> wanted) {
  const char* environment = std::getenv("ROS_DOMAIN_ID");
  const std::string text = wanted ? std::to_string(*wanted) : environment ? environment : "";
  if (text.empty()) return 0;
  if (const auto domain = parse_whole(text, 0, kLargestDomain)) return *domain;
  return Error{Code::kInvalidArgument, fmt::format("{}: got '{}', wanted 0 to {}",
                                                   wanted ? "--domain" : "ROS_DOMAIN_ID", text, kLargestDomain)};
}

int multicast_port(int domain) { return 7400 + kPortsPerDomain * domain; }

int unicast_port(int domain, int participant) { return multicast_port(domain) + 10 + 2 * participant; }

std::optional<PortTrouble> port_trouble(int domain) {
  int first = 0, last = 0;
  if (!(std::ifstream("/proc/sys/net/ipv4/ip_local_port_range") >> first >> last)) return {};
  const int begin = multicast_port(domain), end = std::min(begin + kPortsPerDomain - 1, 65535);
  if (end < first || begin > last || all_reserved(begin, end)) return {};
  return PortTrouble{
      fmt::format("its UDP ports, {} to {}, are among those that Linux gives to any program ({} to {}), which then "
                  "gets what was "
                  "meant for one of ours",
                  begin, end, first, last),
      fmt::format("a ROS_DOMAIN_ID below {}, or sysctl -w net.ipv4.ip_local_reserved_ports={}-{} on each host",
                  (first - multicast_port(0)) / kPortsPerDomain, begin, end)};
}

}  // namespace jostle::common
