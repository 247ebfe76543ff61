#include "physics_pool/local/executor.hpp"

#include <algorithm>

namespace jostle::physics_pool {
namespace {

// A thread's simulators, most recently used first. Re-planning alternates
// between very few worlds; more would only hold memory.
class SimulatorCache {
 public:
  Simulator& of(const WorldPtr& world) {
    const auto found = std::ranges::find_if(
        cache_, [&](const auto& simulator) { return &simulator->world() == world.get(); });
    if (found != cache_.end()) {
      std::rotate(cache_.begin(), found, found + 1);
    } else {
      if (cache_.size() == kKept) cache_.pop_back();
      cache_.insert(cache_.begin(), std::make_unique<Simulator>(world));
    }
    return *cache_.front();
  }

 private:
  static constexpr std::size_t kKept = 4;
  std::vector<std::unique_ptr<Simulator>> cache_;
};

}  // namespace

Executor::Executor(int threads) {
  for (int i = 0; i < std::max(threads, 1); ++i) {
    threads_.emplace_back([this, i](std::stop_token stop) { work(stop, i); });
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
  SimulatorCache simulators;
  std::unique_lock lock(mutex_);
  while (wake_.wait(lock, stop, [&] { return !jobs_.empty(); }) && !stop.stop_requested()) {
    Job job = std::move(jobs_.front());
    jobs_.pop_front();
    lock.unlock();
    BatchRun& run = *job.run;
    RolloutOutcome outcome{.sample = job.sample};
    if (!run.signals.is_obsolete(job.sample)) {
      outcome = run_rollout(simulators.of(run.world), run.batch, job.sample, run.signals);
    }
    run.on_outcome(std::move(outcome), thread);
    job = {};
    lock.lock();
  }
}

}  // namespace jostle::physics_pool
