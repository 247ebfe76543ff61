#pragma once
/// \file
/// Real worker processes, and the corner of the network they live in.

#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "services/common/process/domain_claim.hpp"

namespace jostle::tests {

using Clock = std::chrono::steady_clock;

/// A deadline `time` from now.
template <class Duration>
Clock::time_point in(Duration time) {
  return Clock::now() + time;
}

/// A DDS domain that no other test process on this machine uses; held until this one ends.
inline int test_domain() {
  static const auto own_result = common::claim_some_domain();
  if (!own_result) throw std::runtime_error(own_result.error().message);
  return own_result->domain;
}

/// Whether a condition came true by the deadline.
inline bool eventually(Clock::time_point deadline, const std::function<bool()>& condition) {
  while (!condition()) {
    if (Clock::now() >= deadline) return false;
    std::this_thread::yield();
  }
  return true;
}

/// One jostle_worker, killed at the end of its scope.
class WorkerProcess {
 public:
  explicit WorkerProcess(int domain, int threads = 1) {
    std::vector<std::string> words{JOSTLE_WORKER,           "--domain",          std::to_string(domain),  "--threads",
                                   std::to_string(threads), "--die-with-parent", std::to_string(getpid())};
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    if (posix_spawn(&pid_, JOSTLE_WORKER, nullptr, nullptr, arguments.data(), environ) != 0) {
      throw std::runtime_error("cannot start " + words.front());
    }
  }
  ~WorkerProcess() {
    if (pid_ > 0) end(SIGKILL);
  }
  WorkerProcess(WorkerProcess&& other) noexcept : pid_(std::exchange(other.pid_, -1)) {}
  WorkerProcess& operator=(WorkerProcess&& other) noexcept {
    std::swap(pid_, other.pid_);
    return *this;
  }

  pid_t pid() const { return pid_; }

  void signal(int number) const { kill(pid_, number); }

  /// Sends a signal, waits, and gives the status of waitpid(2).
  int end(int number) {
    signal(number);
    int status = 0;
    waitpid(std::exchange(pid_, -1), &status, 0);
    return status;
  }

 private:
  pid_t pid_ = -1;
};

}  // namespace jostle::tests
