#include "services/common/lab/hosts.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/if.h>
#include <linux/if_tun.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/mount.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <future>
#include <mutex>
#include <stdexcept>
#include <system_error>
#include <thread>

#include "services/common/process/presence.hpp"

namespace jostle::common {
namespace {

// Frames a TAP device holds for us: a message of 1 MiB is 700 of them, and the thread
// that fetches them may be late on a busy machine.
constexpr int kQueue = 10'000;
constexpr std::chrono::seconds kCablePatience{10};

int check(int result, const char* what) {
  if (result < 0) throw std::system_error(errno, std::generic_category(), what);
  return result;
}

void ip(const std::string& arguments) {
  if (std::system(("ip " + arguments).c_str()) != 0) {
    throw std::runtime_error(fmt::format("`ip {}` failed; it is in the package iproute2", arguments));
  }
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

// The kernel says up to a second late that a cable is in. Until then the middleware sees no
// network, and a discovery server cannot be made.
void wait_for_cable(const std::string& address) {
  const auto deadline = std::chrono::steady_clock::now() + kCablePatience;
  while (!reachable_addresses().contains(address)) {
    if (std::chrono::steady_clock::now() > deadline) throw std::runtime_error("no cable is seen at " + address);
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
}

}  // namespace

// A thread with a network and a /dev/shm of its own, which what it starts inherits.
//
// One that stays: a process that asked to end with its parent ends with the thread that
// started it (prctl(2), PR_SET_PDEATHSIG).
class Hosts::Resident {
 public:
  Resident() : thread_([this](std::stop_token stop) { serve(stop); }) {
    run([] {
      check(unshare(CLONE_FS | CLONE_NEWNS | CLONE_NEWNET), "unshare");
      check(mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr), "mount /");
      check(mount("tmpfs", "/dev/shm", "tmpfs", 0, nullptr), "mount /dev/shm");
    });
  }

  void run(const std::function<void()>& act) {
    if (std::this_thread::get_id() == thread_.get_id()) return act();
    std::packaged_task<void()> task(act);
    std::future<void> done = task.get_future();
    {
      const std::lock_guard lock(mutex_);
      tasks_.push_back(std::move(task));
    }
    wake_.notify_one();
    done.get();
  }

  /// Its network, as a file that others can name.
  std::string network() {
    std::string file;
    run([&] { file = fmt::format("/proc/{}/task/{}/ns/net", getpid(), gettid()); });
    return file;
  }

 private:
  void serve(std::stop_token stop) {
    std::unique_lock lock(mutex_);
    while (wake_.wait(lock, stop, [&] { return !tasks_.empty(); })) {
      std::packaged_task<void()> task = std::move(tasks_.front());
      tasks_.pop_front();
      lock.unlock();
      task();
      lock.lock();
    }
  }

  std::mutex mutex_;  // guards tasks_
  std::condition_variable_any wake_;
  std::deque<std::packaged_task<void()>> tasks_;
  std::jthread thread_;  // last: uses all of the above
};

Hosts::Hosts() = default;
Hosts::~Hosts() = default;

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
                             "under `unshare --user --map-root-user`",
                             problem.what())};
  }
  return hosts;
}

void Hosts::build(int count, const LinkQuality& quality) {
  if (!quality.perfect()) cables_ = std::make_unique<Cables>(quality);
  switch_ = std::make_unique<Resident>();
  switch_->run([] { ip("link add hub type bridge"), ip("link set hub up"); });
  for (int host = 1; host <= count; ++host) {
    hosts_.push_back(std::make_unique<Resident>());
    connect(host, quality);
    on(host, [&] {
      ip("link set lo up");
      ip(fmt::format("addr add {}/24 dev eth", address(host)));
      ip("link set eth up");
      ip("route add 239.0.0.0/8 dev eth");
    });
    switch_->run([&] { ip(fmt::format("link set port{} master hub", host)); });
    plug(host, true);
  }
  if (cables_) cables_->start();
  for (int host = 1; host <= count; ++host) on(host, [&] { wait_for_cable(address(host)); });
}

// A cable that is perfect is the kernel's, and costs no thread.
void Hosts::connect(int host, const LinkQuality& quality) {
  const std::string port = fmt::format("port{}", host);
  if (quality.perfect()) {
    const std::string network = switch_->network();
    on(host, [&] { ip(fmt::format("link add eth type veth peer name {} netns {}", port, network)); });
    return;
  }
  int host_end = -1, switch_end = -1;
  on(host, [&] { host_end = new_tap("eth"); });
  switch_->run([&] { switch_end = new_tap(port); });
  cables_->add(host_end, switch_end);
}

void Hosts::on(int host, const std::function<void()>& act) const {
  hosts_.at(static_cast<std::size_t>(host - 1))->run(act);
}

void Hosts::plug(int host, bool in) const {
  switch_->run([&] { ip(fmt::format("link set port{} {}", host, in ? "up" : "down")); });
}

CableCounts Hosts::counts() const { return cables_ ? cables_->counts() : CableCounts{}; }

}  // namespace jostle::common
