#include "physics_pool/local/executor.hpp"

#include <pthread.h>

#include <algorithm>
#include <string>
#include <system_error>

#include "physics_pool/local/reduced_simulator.hpp"
#include "physics_pool/local/simulator.hpp"

namespace jostle::physics_pool {
namespace {

// A thread's dynamics, most recently used first. Re-planning alternates between
// very few worlds and fidelities; more would only hold memory.
class DynamicsCache {
 public:
  Dynamics& of(const WorldPtr& world, const Fidelity& fidelity) {
    const auto found = std::ranges::find_if(cache_, [&](const Entry& entry) {
      return &entry.dynamics->world() == world.get() && entry.fidelity == fidelity;
    });
    if (found != cache_.end()) {
      std::rotate(cache_.begin(), found, found + 1);
    } else {
      if (cache_.size() == kKept) cache_.pop_back();
      cache_.insert(cache_.begin(), {fidelity, make(world, fidelity)});
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

  static constexpr std::size_t kKept = 4;
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

Executor::Executor(int threads, const std::vector<int>& cores) {
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
  DynamicsCache dynamics;
  std::unique_lock lock(mutex_);
  while (wake_.wait(lock, stop, [&] { return !jobs_.empty(); }) && !stop.stop_requested()) {
    Job job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    BatchRun& run = *job.run;
    RolloutOutcome outcome{.sample = job.sample};
    Shift shift{.thread = thread, .started = std::chrono::steady_clock::now()};
    if (!run.signals.is_obsolete(job.sample)) {
      outcome = run_rollout(dynamics.of(run.world, run.batch.fidelity), run.batch, job.sample, run.signals);
    }
    shift.finished = std::chrono::steady_clock::now();
    run.on_outcome(std::move(outcome), shift);
    job = {};
    lock.lock();
  }
}

}  // namespace jostle::physics_pool
