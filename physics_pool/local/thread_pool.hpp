#pragma once
/// \file
/// The in-process Pool.

#include <memory>
#include <mutex>
#include <unordered_map>

#include "physics_pool/api/pool.hpp"
#include "physics_pool/local/executor.hpp"

namespace jostle::physics_pool {

/// Pool of threads in this process. Destroy it after every `run` has returned.
class ThreadPool final : public Pool {
 public:
  explicit ThreadPool(int threads);

  Result<Hash> load(const Scene& scene) override;
  Result<BatchReply> run(const RolloutBatch& batch, TimePoint deadline,
                         std::stop_token stop = {}) override;
  PoolStatus status() const override;

 private:
  mutable std::mutex mutex_;  // guards worlds_ and workers_
  std::unordered_map<Hash, WorldPtr> worlds_;
  std::vector<WorkerStatus> workers_;
  Executor executor_;
};

}  // namespace jostle::physics_pool
