#include "services/common/process/presence.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>
#include <time.h>

#include <mutex>
#include <utility>

#include "services/common/process/program.hpp"

namespace jostle::common {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kGlance{200};

// Goes on while the machine sleeps, as steady_clock does not.
milliseconds now() {
  timespec time{};
  clock_gettime(CLOCK_BOOTTIME, &time);
  return std::chrono::duration_cast<milliseconds>(std::chrono::seconds(time.tv_sec) +
                                                  std::chrono::nanoseconds(time.tv_nsec));
}

}  // namespace

std::set<std::string> reachable_addresses() {
  std::set<std::string> addresses;
  ifaddrs* all = nullptr;
  if (getifaddrs(&all) != 0) return addresses;
  for (const ifaddrs* one = all; one; one = one->ifa_next) {
    if (!one->ifa_addr || one->ifa_addr->sa_family != AF_INET) continue;
    if (!(one->ifa_flags & IFF_RUNNING) || (one->ifa_flags & IFF_LOOPBACK)) continue;
    char text[INET_ADDRSTRLEN] = "";
    inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(one->ifa_addr)->sin_addr, text, sizeof text);
    addresses.insert(text);
  }
  freeifaddrs(all);
  return addresses;
}

std::string wait_until_forgotten(std::set<std::string> known, milliseconds pause, std::stop_token stop) {
  for (milliseconds last = now(); !stop.stop_requested();) {
    pause_until(std::chrono::steady_clock::now() + kGlance, stop);
    const std::set<std::string> addresses = reachable_addresses();
    for (const std::string& address : addresses) {
      if (!known.contains(address)) return fmt::format("address {} is there, and was not all the time", address);
    }
    std::erase_if(known, [&](const std::string& address) { return !addresses.contains(address); });
    const milliseconds away = now() - std::exchange(last, now());
    if (away > kGlance + pause) return fmt::format("did not run for {} ms", away.count());
  }
  return "";
}

}  // namespace jostle::common
