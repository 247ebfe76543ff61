#pragma once
/// \file
/// Several hosts on one machine: network namespaces on a switch.

#include <fcntl.h>
#include <sched.h>
#include <sys/mount.h>
#include <unistd.h>

#include <fmt/format.h>

#include <cerrno>
#include <cstdlib>
#include <exception>
#include <functional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

namespace jostle::tests {

/// Hosts 10.77.0.1, 10.77.0.2, ... with links to one switch. Each has its own
/// addresses, ports and shared memory, and nothing of them reaches the outside.
/// Gone when the last process in them is. Needs root.
class Hosts {
 public:
  explicit Hosts(int count) : switch_(new_network()) {
    inside(switch_, [] { ip("link add hub type bridge"), ip("link set hub up"); });
    for (int host = 1; host <= count; ++host) {
      const int network = new_network();
      networks_.push_back(network);
      inside(network, [&] {
        ip("link set lo up");
        ip(fmt::format("link add eth type veth peer name port{} netns /proc/{}/fd/{}", host, getpid(), switch_));
        ip(fmt::format("addr add {}/24 dev eth", address(host)));
        ip("link set eth up");
        ip("route add 239.0.0.0/8 dev eth");
      });
      inside(switch_, [&] { ip(fmt::format("link set port{} master hub", host)); });
      plug(host, true);
    }
  }
  ~Hosts() {
    for (const int network : networks_) close(network);
    close(switch_);
  }
  Hosts(const Hosts&) = delete;
  Hosts& operator=(const Hosts&) = delete;

  static std::string address(int host) { return fmt::format("10.77.0.{}", host); }

  /// What is started in there lives on that host.
  void on(int host, const std::function<void()>& start) const {
    inside(networks_.at(static_cast<std::size_t>(host - 1)), [&] {
      check(unshare(CLONE_FS | CLONE_NEWNS), "unshare");
      check(mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr), "mount /");
      check(mount("tmpfs", "/dev/shm", "tmpfs", 0, nullptr), "mount /dev/shm");
      start();
    });
  }

  /// The cable between a host and the switch.
  void plug(int host, bool in) const {
    inside(switch_, [&] { ip(fmt::format("link set port{} {}", host, in ? "up" : "down")); });
  }

 private:
  static void check(int result, const char* what) {
    if (result < 0) throw std::system_error(errno, std::generic_category(), what);
  }

  static void ip(const std::string& arguments) {
    if (std::system(("ip " + arguments).c_str()) != 0) throw std::runtime_error("ip " + arguments);
  }

  // On a thread of its own: a namespace belongs to a thread.
  static void inside(int network, const std::function<void()>& act) {
    std::exception_ptr problem;
    std::thread([&] {
      try {
        check(setns(network, CLONE_NEWNET), "setns");
        act();
      } catch (...) {
        problem = std::current_exception();
      }
    }).join();
    if (problem) std::rethrow_exception(problem);
  }

  static int new_network() {
    int network = -1;
    std::thread([&] {
      if (unshare(CLONE_NEWNET) == 0) network = open("/proc/thread-self/ns/net", O_RDONLY | O_CLOEXEC);
    }).join();
    check(network, "a new network namespace (root?)");
    return network;
  }

  int switch_;
  std::vector<int> networks_;
};

}  // namespace jostle::tests
