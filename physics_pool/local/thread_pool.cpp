#include "physics_pool/local/thread_pool.hpp"

#include <fmt/format.h>

namespace jostle::physics_pool {

ThreadPool::ThreadPool(int threads) : executor_(threads) {
  for (int i = 0; i < executor_.threads(); ++i) {
    workers_.push_back({.name = fmt::format("thread-{}", i)});
  }
}

Result<Hash> ThreadPool::load(const Scene& scene) {
  const Hash hash = scene_hash(scene);
  const std::lock_guard lock(mutex_);
  if (!worlds_.contains(hash)) {
    auto world_result = World::compile(scene);
    if (!world_result) return world_result.error();
    worlds_.emplace(hash, std::move(world_result).value());
  }
  return hash;
}

Result<BatchReply> ThreadPool::run(const RolloutBatch& batch, TimePoint deadline,
                                   std::stop_token stop) {
  // Shared with the samples, which may outlive this call by a moment.
  struct Progress {
    std::mutex mutex;  // guards reply and missing
    std::condition_variable_any done;
    BatchReply reply;
    std::size_t missing = 0;
  };
  const auto progress = std::make_shared<Progress>();
  const auto run = std::make_shared<BatchRun>();
  {
    const std::lock_guard lock(mutex_);
    const auto found = worlds_.find(batch.world);
    if (found == worlds_.end()) {
      return Error{Code::kUnknownWorld,
                   fmt::format("world: got {}, wanted one given to load() before", to_string(batch.world))};
    }
    run->world = found->second;
  }
  if (auto ok = validate(batch, run->world->geometry().layout, run->world->time_step()); !ok) {
    return ok.error();
  }
  run->batch = batch;
  progress->reply.outcomes.resize(batch.samples);
  progress->missing = batch.samples;
  run->on_outcome = [this, progress, first = batch.first_sample](RolloutOutcome outcome, int thread) {
    {
      const std::lock_guard lock(mutex_);
      workers_[static_cast<std::size_t>(thread)].rollouts += 1;
      workers_[static_cast<std::size_t>(thread)].engine_steps += outcome.engine_steps;
    }
    const std::lock_guard lock(progress->mutex);
    progress->reply.outcomes[outcome.sample - first] = std::move(outcome);
    if (--progress->missing == 0) progress->done.notify_all();
  };
  for (std::uint32_t i = 0; i < batch.samples; ++i) executor_.submit(run, batch.first_sample + i);

  std::unique_lock lock(progress->mutex);
  const auto complete = [&] { return progress->missing == 0; };
  if (!progress->done.wait_until(lock, stop, deadline, complete)) {
    // Running samples notice within one engine step; waiting for them keeps
    // the promise that nothing of this batch runs after the call.
    run->signals.cancel();
    const std::size_t late = progress->missing;
    progress->done.wait(lock, complete);
    if (stop.stop_requested()) return Error{Code::kCancelled, "batch: cancelled by its caller"};
    return Error{Code::kDeadline,
                 fmt::format("batch: {} of {} rollouts were unfinished at the deadline", late, batch.samples)};
  }
  progress->reply.winner = select_winner(progress->reply.outcomes, batch.incumbent);
  return std::move(progress->reply);
}

PoolStatus ThreadPool::status() const {
  const std::lock_guard lock(mutex_);
  return {.workers = workers_};
}

}  // namespace jostle::physics_pool
