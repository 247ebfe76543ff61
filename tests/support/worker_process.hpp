#pragma once
/// \file
/// Real worker processes.

#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/test_domain.hpp"

namespace jostle::tests {

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
