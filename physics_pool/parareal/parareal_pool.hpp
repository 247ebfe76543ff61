#pragma once
/// \file
/// PararealPool: one pool turned into a faster, slightly less exact one.

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "physics_pool/api/pool.hpp"
#include "physics_pool/coarse/coarse_model.hpp"
#include "physics_pool/parareal/iteration.hpp"
#include "physics_pool/parareal/split.hpp"

namespace jostle::physics_pool {

struct PararealOptions {
  std::string model = "planar";  ///< a name that make_coarse_model takes
  PararealStop stop;             ///< iterations 0 predicts with the coarse model alone
  /// Chooses per batch between whole rollouts and slices (split.hpp), from measured times.
  /// The choice depends on the machine, so plans repeat bit for bit only when this is off.
  bool split_by_itself = false;
  /// Hears of every choice that differs from the one before.
  std::function<void(const std::string& why)> on_split;
};

/// Predicts with Parareal: every sample of a batch is cut into its control steps, and the
/// slices of all samples go to the pool underneath, whichever that is, as batches of one
/// step. A slice runs as soon as its start state is known, early iterations first; the
/// caller's thread does the coarse sweeps and corrections. With as many iterations as
/// steps, replies equal those of the pool underneath bit for bit.
///
/// Threads  safe from any thread.
/// Repeats  as Pool: replies do not depend on the workers, their number or loss. A
///          success ends a batch early (samples above it are skipped); losers run to
///          their ends, because their cost is known only then. A batch that waits instead of
///          simulating is passed on.
/// Errors   those of the pool underneath, and of make_coarse_model when a world is
///          loaded. A slice that diverges, or a coarse prediction that is not finite, ends
///          its sample as kDiverged, with the reason.
class PararealPool final : public Pool {
 public:
  /// `pool` must outlive this one.
  PararealPool(AsyncPool& pool, PararealOptions options);
  ~PararealPool() override;

  Result<Hash> load(const Scene& scene) override;
  Result<BatchReply> run(const RolloutBatch& batch, TimePoint deadline, std::stop_token stop = {}) override;
  PoolStatus status() const override { return pool_.status(); }

  /// Slices that have come back, since the start.
  std::uint64_t slices() const;

 private:
  struct Known;
  class Lease;
  struct Sample;
  class Run;

  Result<Split> choose(Known& known, const RolloutBatch& batch, TimePoint deadline, std::stop_token stop);

  AsyncPool& pool_;
  PararealOptions options_;
  mutable std::mutex mutex_;  // guards worlds_, their idle models and times, said_, slices_
  std::map<Hash, std::unique_ptr<Known>> worlds_;
  std::string said_;
  std::uint64_t slices_ = 0;
};

}  // namespace jostle::physics_pool
