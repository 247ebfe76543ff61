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
#include "idl/types/time.hpp"
#include "physics_pool/api/rollout.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

using jostle::TimePoint;

/// One worker as its pool sees it. In a pool of threads each thread counts as a worker.
struct WorkerStatus {
  std::uint64_t id = 0;  ///< different for any two workers of a pool, whatever their names
  std::string name;
  std::string host;                ///< empty for a thread
  std::uint32_t pid = 0;           ///< of its process; 0 for a thread
  int capacity = 1;                ///< rollouts at a time
  std::uint64_t rollouts = 0;      ///< finished for this client
  std::uint64_t engine_steps = 0;  ///< physics steps of those
  bool alive = true;
};

struct PoolStatus {
  std::vector<WorkerStatus> workers;
  std::uint64_t reissued = 0;    ///< samples given to another worker after a death or a stall
  std::uint64_t duplicates = 0;  ///< results that came late or twice, counted and dropped
};

/// Runs batches of rollouts.
///
///   x[0]   = x0
///   x[t+1] = F(x[t], u[t])    reset the solver's warm start, set state, run Delta_t
///   J      = sum_i w_i·phi_i(x[n]) + sum_{t<n} sum_i w_i·q_i(u[t-1], u[t], x[t], x[t+1], facts[t])
///
/// with i over the terms of batch.objective: term i has weight w_i, and its kind (objective/catalogue.hpp) a final
/// cost phi_i, a running cost q_i, or both. u[-1] is batch.u_before; facts[t] is what happened in step t (StepFacts).
///
/// Source   Eq. 3.1 and lines 3-9 of Alg. 1; the terms of J are those of Eq. 3.2, 4.36, 4.37, 6.10 and Sec. 7.3.
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

  /// Runs several batches, whose rollouts may share the workers, and returns their replies in the same order. The
  /// replies are those of `run`, and come sooner where the pool can have several batches under way.
  /// Errors   the first error of any batch; the other batches are cancelled
  virtual Result<std::vector<BatchReply>> run_all(std::span<const RolloutBatch> batches, TimePoint deadline,
                                                  std::stop_token stop = {});

  virtual PoolStatus status() const = 0;
};

/// An AsyncPool takes a batch at any time, while others run. The slices of a trajectory need that: each
/// starts as soon as its start state is known.
class AsyncPool : public Pool {
 public:
  /// A batch under way. Destroying its ticket before the reply cancels the batch: then on_reply is
  /// never called. A ticket must not be destroyed from within on_reply, nor after the pool.
  class Ticket {
   public:
    virtual ~Ticket() = default;
    virtual std::uint32_t missing() const = 0;  ///< samples that have not come back
  };

  /// Takes the reply of a batch. Called once, from a thread of the pool; must be quick and must not call the pool.
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
