#include "services/support/hosts.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/if.h>
#include <linux/if_tun.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <stdexcept>
#include <system_error>
#include <thread>
#include <utility>

namespace jostle::services {
namespace {

// Frames a TAP device holds for us: a message of 1 MiB is 700 of them, and the thread
// that fetches them may be late on a busy machine.
constexpr int kQueue = 10'000;

int check(int result, const char* what) {
  if (result < 0) throw std::system_error(errno, std::generic_category(), what);
  return result;
}

void ip(const std::string& arguments) {
  if (std::system(("ip " + arguments).c_str()) != 0) {
    throw std::runtime_error(fmt::format("`ip {}` failed; it is in the package iproute2", arguments));
  }
}

// A namespace belongs to a thread.
void on_a_thread(const std::function<void()>& act) {
  std::exception_ptr problem;
  std::thread([&] {
    try {
      act();
    } catch (...) {
      problem = std::current_exception();
    }
  }).join();
  if (problem) std::rethrow_exception(problem);
}

// An Ethernet device of this network whose other side is a file.
int new_tap(const std::string& name) {
  const int tap = check(open("/dev/net/tun", O_RDWR | O_NONBLOCK | O_CLOEXEC), "/dev/net/tun");
  ifreq request{};
  request.ifr_flags = IFF_TAP | IFF_NO_PI;
  std::strncpy(request.ifr_name, name.c_str(), IFNAMSIZ - 1);
  if (ioctl(tap, TUNSETIFF, &request) < 0) {
    const int code = errno;
    close(tap);
    throw std::system_error(code, std::generic_category(), "TAP device " + name);
  }
  ip(fmt::format("link set {} txqueuelen {}", name, kQueue));
  return tap;
}

}  // namespace

std::string Hosts::address(int host) { return fmt::format("10.77.0.{}", host); }

Result<std::unique_ptr<Hosts>> Hosts::make(int count, const LinkQuality& quality) {
  if (count < 1 || count > 254) {
    return Error{Code::kInvalidArgument, fmt::format("hosts: got {}, wanted 1 to 254", count)};
  }
  std::unique_ptr<Hosts> hosts(new Hosts());
  try {
    hosts->build(count, quality);
  } catch (const std::exception& problem) {
    return Error{Code::kUnavailable,
                 fmt::format("hosts as network namespaces: {}; wanted the right to make them: run it as root, or "
                             "under `unshare --user --map-root-user`", problem.what())};
  }
  return hosts;
}

void Hosts::build(int count, const LinkQuality& quality) {
  if (!quality.perfect()) cables_ = std::make_unique<Cables>(quality);
  switch_ = new_place();
  inside(switch_, [] { ip("link add hub type bridge"), ip("link set hub up"); });
  for (int host = 1; host <= count; ++host) {
    places_.push_back(new_place());
    connect(host, quality);
    inside(places_.back(), [&] {
      ip("link set lo up");
      ip(fmt::format("addr add {}/24 dev eth", address(host)));
      ip("link set eth up");
      ip("route add 239.0.0.0/8 dev eth");
    });
    inside(switch_, [&] { ip(fmt::format("link set port{} master hub", host)); });
    plug(host, true);
  }
  if (cables_) cables_->start();
}

// A cable that is perfect is the kernel's, and costs no thread.
void Hosts::connect(int host, const LinkQuality& quality) {
  const std::string port = fmt::format("port{}", host);
  if (quality.perfect()) {
    inside(places_.back(), [&] {
      ip(fmt::format("link add eth type veth peer name {} netns /proc/{}/fd/{}", port, getpid(), switch_.network));
    });
    return;
  }
  int host_end = -1, switch_end = -1;
  inside(places_.back(), [&] { host_end = new_tap("eth"); });
  inside(switch_, [&] { switch_end = new_tap(port); });
  cables_->add(host_end, switch_end);
}

Hosts::~Hosts() {
  places_.push_back(switch_);
  for (const Place& place : places_) {
    if (place.network >= 0) close(place.network);
    if (place.mounts >= 0) close(place.mounts);
  }
}

void Hosts::on(int host, const std::function<void()>& act) const {
  inside(places_.at(static_cast<std::size_t>(host - 1)), act);
}

void Hosts::plug(int host, bool in) const {
  inside(switch_, [&] { ip(fmt::format("link set port{} {}", host, in ? "up" : "down")); });
}

CableCounts Hosts::counts() const { return cables_ ? cables_->counts() : CableCounts{}; }

void Hosts::inside(const Place& place, const std::function<void()>& act) {
  on_a_thread([&] {
    // Entering a mount namespace leads to its root; what is started should not notice.
    char here[PATH_MAX];
    const bool known = getcwd(here, sizeof here) != nullptr;
    check(unshare(CLONE_FS), "unshare");
    check(setns(place.mounts, CLONE_NEWNS), "setns");
    check(setns(place.network, CLONE_NEWNET), "setns");
    if (known) check(chdir(here), here);
    act();
  });
}

Hosts::Place Hosts::new_place() {
  Place place;
  on_a_thread([&] {
    check(unshare(CLONE_FS | CLONE_NEWNS | CLONE_NEWNET), "unshare");
    check(mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr), "mount /");
    check(mount("tmpfs", "/dev/shm", "tmpfs", 0, nullptr), "mount /dev/shm");
    place.network = check(open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC), "ns/net");
    place.mounts = check(open("/proc/thread-self/ns/mnt", O_RDONLY | O_CLOEXEC), "ns/mnt");
  });
  return place;
}

}  // namespace jostle::services
