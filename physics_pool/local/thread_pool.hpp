#pragma once
/// \file
/// The in-process Pool.

#include <memory>
#include <mutex>
#include <unordered_map>

#include "physics_pool/api/pool.hpp"
#include "physics_pool/local/executor.hpp"

namespace jostle::physics_pool {

/// A pool of threads in this process. Destroy it after every `run` has returned and
/// every ticket is gone; destroying a ticket waits for its running samples (a millisecond).
class ThreadPool final : public AsyncPool {
 public:
  explicit ThreadPool(int threads);

  Result<Hash> load(const Scene& scene) override;
  Result<std::unique_ptr<Ticket>> submit(const RolloutBatch& batch, OnReply on_reply) override;
  PoolStatus status() const override;

 private:
  class Running;

  mutable std::mutex mutex_;  // guards worlds_ and workers_
  std::unordered_map<Hash, WorldPtr> worlds_;
  std::vector<WorkerStatus> workers_;
  Executor executor_;
};

}  // namespace jostle::physics_pool
