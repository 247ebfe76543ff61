#include "physics_pool/local/executor.hpp"

#include <pthread.h>

#include <algorithm>
#include <exception>
#include <string>
#include <system_error>

#include "physics_pool/local/reduced_simulator.hpp"
#include "physics_pool/local/simulator.hpp"

namespace jostle::physics_pool {
namespace {

// A thread's dynamics, most recently used first. Re-planning alternates between very few worlds and fidelities, robust
// planning between as many as it imagines.
class DynamicsCache {
 public:
  explicit DynamicsCache(std::size_t bytes) : bytes_(bytes) {}

  Dynamics& of(const WorldPtr& world, const Fidelity& fidelity) {
    const auto found = std::ranges::find_if(cache_, [&](const Entry& entry) {
      return &entry.dynamics->world() == world.get() && entry.fidelity == fidelity;
    });
    if (found != cache_.end()) {
      std::rotate(cache_.begin(), found, found + 1);
    } else {
      cache_.insert(cache_.begin(), {fidelity, make(world, fidelity)});
      shrink();
    }
    return *cache_.front().dynamics;
  }

 private:
  struct Entry {
    Fidelity fidelity;
    std::unique_ptr<Dynamics> dynamics;
  };

  static std::unique_ptr<Dynamics> make(const WorldPtr& world, const Fidelity& fidelity) {
    if (fidelity == Fidelity{}) return std::make_unique<Simulator>(world);
    return std::make_unique<ReducedSimulator>(world, fidelity);
  }

  // Dynamics grow while they are used, so all are asked.
  void shrink() {
    std::size_t sum = 0;
    for (std::size_t i = 0; i < cache_.size(); ++i) {
      sum += cache_[i].dynamics->bytes();
      if (i > 0 && sum > bytes_) {
        cache_.resize(i);
        return;
      }
    }
  }

  const std::size_t bytes_;
  std::vector<Entry> cache_;
};

void pin(std::jthread& thread, int core) {
  cpu_set_t only;
  CPU_ZERO(&only);
  CPU_SET(core, &only);
  if (const int problem = pthread_setaffinity_np(thread.native_handle(), sizeof only, &only)) {
    throw std::system_error(problem, std::generic_category(), "core " + std::to_string(core));
  }
}

}  // namespace

Executor::Executor(int threads, const std::vector<int>& cores, std::size_t bytes_per_thread)
    : bytes_per_thread_(bytes_per_thread) {
  for (int i = 0; i < std::max(threads, 1); ++i) {
    threads_.emplace_back([this, i](std::stop_token stop) { work(stop, i); });
    if (i < static_cast<int>(cores.size())) pin(threads_.back(), cores[static_cast<std::size_t>(i)]);
  }
}

Executor::~Executor() {
  for (std::jthread& thread : threads_) thread.request_stop();
  wake_.notify_all();
}

void Executor::submit(BatchRunPtr run, std::uint32_t sample) {
  {
    const std::lock_guard lock(mutex_);
    jobs_.push_back({std::move(run), sample});
  }
  wake_.notify_one();
}

void Executor::work(std::stop_token stop, int thread) {
  DynamicsCache dynamics(bytes_per_thread_);
  std::unique_lock lock(mutex_);
  while (wake_.wait(lock, stop, [&] { return !jobs_.empty(); }) && !stop.stop_requested()) {
    Job job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    BatchRun& run = *job.run;
    RolloutOutcome outcome{.sample = job.sample};
    Shift shift{.thread = thread, .started = std::chrono::steady_clock::now()};
    if (!run.signals.is_obsolete(job.sample)) {
      try {
        outcome = run_rollout(dynamics.of(run.world, run.batch.fidelity), run.batch, job.sample, run.signals);
      } catch (const std::exception& error) {  // no memory for the engine's scratch
        outcome = {.sample = job.sample, .end = End::kDiverged, .reason = error.what()};
      }
    }
    shift.finished = std::chrono::steady_clock::now();
    run.on_outcome(std::move(outcome), shift);
    job = {};
    lock.lock();
  }
}

}  // namespace jostle::physics_pool
