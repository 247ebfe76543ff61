#pragma once
/// \file
/// Threads that run rollouts, one at a time each, in the order they arrive.
/// The in-process pool and the worker process both stand on it.

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "physics_pool/local/rollout.hpp"

namespace jostle::physics_pool {

/// Where and when a sample ran.
struct Shift {
  int thread = 0;  ///< from 0
  std::chrono::steady_clock::time_point started, finished;
};

/// A batch on its way: what its rollouts read and whom they tell.
struct BatchRun {
  RolloutBatch batch;
  WorldPtr world;
  BatchSignals signals;
  /// Called once for every submitted sample, on the thread that ran it (or
  /// skipped it); must be quick and must not throw. It may submit more.
  std::function<void(RolloutOutcome, const Shift&)> on_outcome;
};
/// Shared by the submitter and every queued sample; the last one drops it.
using BatchRunPtr = std::shared_ptr<BatchRun>;

class Executor {
 public:
  static constexpr std::size_t kBytesPerThread = std::size_t{128} << 20;

  /// `cores`: thread i stays on cores[i], if there are any; else the system chooses.
  /// `bytes_per_thread`: room for simulators that a thread keeps for the next batch; the one in use is always kept.
  /// Throws std::system_error when this process may not use one of the cores.
  explicit Executor(int threads, const std::vector<int>& cores = {}, std::size_t bytes_per_thread = kBytesPerThread);
  /// Skips what is queued and waits for what runs (a millisecond once its
  /// signals are cancelled; a whole rollout otherwise).
  ~Executor();

  int threads() const { return static_cast<int>(threads_.size()); }

  /// Queues one sample. Thread safe.
  void submit(BatchRunPtr run, std::uint32_t sample);

 private:
  struct Job {
    BatchRunPtr run;
    std::uint32_t sample = 0;
  };

  void work(std::stop_token stop, int thread);

  const std::size_t bytes_per_thread_;
  std::mutex mutex_;  // guards jobs_
  std::condition_variable_any wake_;
  std::deque<Job> jobs_;
  std::vector<std::jthread> threads_;
};

}  // namespace jostle::physics_pool
