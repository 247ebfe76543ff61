#pragma once
/// \file
/// One rollout on one thread, aware of its siblings.

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>

#include "physics_pool/api/rollout.hpp"
#include "physics_pool/local/dynamics.hpp"

namespace jostle::physics_pool {

/// What the rollouts of one batch tell each other while they run.
class BatchSignals {
 public:
  /// Takes a finished rollout's cost; rollouts that cannot beat the best one stop.
  void offer_cost(double cost) { lower(best_, cost); }
  /// Notes that a rollout succeeded; those with a higher index need not run.
  void offer_success(std::uint32_t sample) {
    lower(first_success_, sample);
    wake();
  }
  void cancel() {
    cancelled_.store(true, std::memory_order_relaxed);
    wake();
  }

  double best() const { return best_.load(std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }
  bool is_obsolete(std::uint32_t sample) const {
    return cancelled() || first_success_.load(std::memory_order_relaxed) < sample;
  }
  /// Sleeps until then, or until the sample is obsolete. True if it is not.
  bool wait_until(std::chrono::steady_clock::time_point end, std::uint32_t sample) {
    std::unique_lock lock(mutex_);
    return !woken_.wait_until(lock, end, [&] { return is_obsolete(sample); });
  }

 private:
  void wake() {
    { const std::lock_guard lock(mutex_); }  // whoever looks now sees the news, or sleeps already
    woken_.notify_all();
  }

  // The value only ever falls, so readers may see it late and stay right.
  template <class T>
  static void lower(std::atomic<T>& shared, T value) {
    T seen = shared.load(std::memory_order_relaxed);
    while (value < seen && !shared.compare_exchange_weak(seen, value)) {
    }
  }

  std::atomic<double> best_{kInfinity};
  std::atomic<std::uint32_t> first_success_{UINT32_MAX};
  std::atomic<bool> cancelled_{false};
  std::mutex mutex_;  // guards nothing: sleepers need one
  std::condition_variable woken_;
};

/// Runs one sample. The batch must have been validated against the world.
///
/// A rollout stops as lost only when its running sum has reached the incumbent
/// or passed the best sibling, and is above the cost at which it could still
/// succeed: costs are >= 0, so it can neither win nor succeed any more. With
/// `stop_hopeless` what is bound to come (bound.hpp) is added for the comparison
/// with the incumbent. When siblings' news arrive is a matter of timing; who wins is not.
///
/// An obsolete rollout (cancelled, or a lower index succeeded) ends as kSkipped.
RolloutOutcome run_rollout(Dynamics& dynamics, const RolloutBatch& batch, std::uint32_t sample, BatchSignals& signals);

}  // namespace jostle::physics_pool
