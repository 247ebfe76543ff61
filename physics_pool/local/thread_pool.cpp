#include "physics_pool/local/thread_pool.hpp"

#include <fmt/format.h>

namespace jostle::physics_pool {

ThreadPool::ThreadPool(int threads) : executor_(threads) {
  for (int i = 0; i < executor_.threads(); ++i) {
    workers_.push_back({.id = static_cast<std::uint64_t>(i) + 1, .name = fmt::format("thread-{}", i)});
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

// A batch whose samples are queued, running or done.
class ThreadPool::Running final : public Ticket {
 public:
  Running(const BatchRunPtr& run, OnReply on_reply) : progress_(std::make_shared<Progress>()), run_(run) {
    progress_->reply.outcomes.resize(run->batch.samples);
    progress_->missing = run->batch.samples;
    progress_->incumbent = run->batch.incumbent;
    progress_->on_reply = std::move(on_reply);
  }

  // Running samples notice within one engine step; waiting for them keeps the
  // promise that nothing of this batch runs any more.
  ~Running() override {
    std::unique_lock lock(progress_->mutex);
    if (!progress_->replied) progress_->on_reply = {};  // before samples end, and with them the batch
    run_->signals.cancel();
    progress_->done.wait(lock, [&] { return progress_->replied; });
  }

  std::uint32_t missing() const override {
    const std::lock_guard lock(progress_->mutex);
    return progress_->missing;
  }

  // What the threads call; it outlives this ticket by a moment.
  auto receiver() const {
    return [progress = progress_, first = run_->batch.first_sample](RolloutOutcome outcome) {
      std::unique_lock lock(progress->mutex);
      progress->reply.outcomes[outcome.sample - first] = std::move(outcome);
      if (--progress->missing > 0) return;
      progress->reply.winner = select_winner(progress->reply.outcomes, progress->incumbent);
      if (progress->on_reply) progress->on_reply(std::move(progress->reply));
      progress->replied = true;
      progress->done.notify_all();
    };
  }

 private:
  struct Progress {
    std::mutex mutex;  // guards everything; held during on_reply, which is quick
    std::condition_variable done;
    BatchReply reply;
    std::uint32_t missing = 0;
    double incumbent = kInfinity;
    OnReply on_reply;
    bool replied = false;
  };

  std::shared_ptr<Progress> progress_;  // with the threads
  BatchRunPtr run_;
};

Result<std::unique_ptr<AsyncPool::Ticket>> ThreadPool::submit(const RolloutBatch& batch, OnReply on_reply) {
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
  auto running = std::make_unique<Running>(run, std::move(on_reply));
  run->on_outcome = [this, receive = running->receiver()](RolloutOutcome outcome, const Shift& shift) {
    {
      const std::lock_guard lock(mutex_);
      workers_[static_cast<std::size_t>(shift.thread)].rollouts += 1;
      workers_[static_cast<std::size_t>(shift.thread)].engine_steps += outcome.engine_steps;
    }
    receive(std::move(outcome));
  };
  for (std::uint32_t i = 0; i < batch.samples; ++i) executor_.submit(run, batch.first_sample + i);
  return std::unique_ptr<Ticket>(std::move(running));
}

PoolStatus ThreadPool::status() const {
  const std::lock_guard lock(mutex_);
  return {.workers = workers_};
}

}  // namespace jostle::physics_pool
