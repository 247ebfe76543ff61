#pragma once
/// \file
/// Pool: many simulations at once, wherever they run.

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "physics_pool/api/rollout.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

using TimePoint = std::chrono::steady_clock::time_point;

/// One worker as its pool sees it. A thread is a worker too.
struct WorkerStatus {
  std::string name;
  int capacity = 1;                ///< rollouts at a time
  std::uint64_t rollouts = 0;      ///< finished for this client
  std::uint64_t engine_steps = 0;  ///< physics steps of those
  bool alive = true;
};

struct PoolStatus {
  std::vector<WorkerStatus> workers;
  std::uint64_t reissued = 0;    ///< tasks given to another worker after a death or a stall
  std::uint64_t duplicates = 0;  ///< results that came late or twice, counted and dropped
};

/// Runs batches of rollouts.
///
///   x[0]   = x0
///   x[t+1] = F(x[t], u[t])    reset the solver's warm start, set state, run Delta_t
///   J      = w_g·c_g(x[n]) + sum_t (w_a·c_a + w_d·c_d + w_e·c_e + topple + drop)
///
/// Source   Eq. 3.1, 3.2 and lines 3-9 of Alg. 1.
/// Threads  safe from any thread; batches share the workers. Where clients share them
///          too, they share by RolloutBatch::priority and, within one, by time.
/// Time     `run` returns by the deadline at the latest, finished or not, and
///          within milliseconds of a stop request.
/// Repeats  the winner, its cost, controls and trajectory are bit-equal for any
///          number of workers, any loss of workers, and with stop_losers on or
///          off. Which losers stopped early, and when, is not.
/// Errors   kInvalidArgument  a field of the batch; the message names it
///          kUnknownWorld     batch.world was never loaded
///          kDeadline         the deadline passed
///          kCancelled        a stop was requested
///          kUnavailable      no worker is left, or none appeared in time
class Pool {
 public:
  virtual ~Pool() = default;

  /// Makes a scene's world known; cheap when it already is.
  virtual Result<Hash> load(const Scene& scene) = 0;

  virtual Result<BatchReply> run(const RolloutBatch& batch, TimePoint deadline, std::stop_token stop = {}) = 0;

  /// Several batches, whose rollouts may share the workers: replies in their order. Equal to `run` of each, only
  /// sooner where the pool can have several under way.
  /// Errors   the first that a batch has; the others are cancelled
  virtual Result<std::vector<BatchReply>> run_all(std::span<const RolloutBatch> batches, TimePoint deadline,
                                                  std::stop_token stop = {});

  virtual PoolStatus status() const = 0;
};

/// A pool whose batches may be left running: many at once, each as soon as it is
/// known. That is what slices of a trajectory need.
class AsyncPool : public Pool {
 public:
  /// A batch under way. Destroying it before its reply cancels it: then on_reply is
  /// never called. Not to be destroyed from within on_reply, nor after the pool.
  class Ticket {
   public:
    virtual ~Ticket() = default;
    virtual std::uint32_t missing() const = 0;  ///< samples that have not come back
  };

  /// Called once, from a thread of the pool's. Must be quick and use nothing of the pool's.
  using OnReply = std::function<void(Result<BatchReply>)>;

  /// Starts a batch and returns. The replies are those of `run`.
  /// Errors   those of `run` that can be told at once
  virtual Result<std::unique_ptr<Ticket>> submit(const RolloutBatch& batch, OnReply on_reply) = 0;

  /// Submits and waits.
  Result<BatchReply> run(const RolloutBatch& batch, TimePoint deadline, std::stop_token stop = {}) final;

  /// Submits all and waits.
  Result<std::vector<BatchReply>> run_all(std::span<const RolloutBatch> batches, TimePoint deadline,
                                          std::stop_token stop = {}) final;
};

}  // namespace jostle::physics_pool
