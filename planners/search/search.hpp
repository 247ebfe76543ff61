#pragma once
/// \file
/// What every planner that samples around a candidate does alike: score,
/// keep the best, report, end.

#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "planners/api/planner.hpp"

namespace jostle::planners {

/// A Search serves one call of Planner::plan. The problem must outlive it.
class Search {
 public:
  /// `pattern`: what all batches have in common, such as the law. World, state, seed and objective are the
  /// problem's, and a success ends a batch.
  Search(physics_pool::Pool& pool, const Problem& problem, physics_pool::RolloutBatch pattern, TimePoint deadline,
         std::stop_token stop, const OnProgress& on_progress);

  /// Returns the cheapest sequence so far; its controls are the initial ones until there is one.
  const Plan& best() const { return best_; }

  /// Makes a batch of one sample around `nominal`, with the noise stream of this iteration and the
  /// best cost as the one to beat.
  physics_pool::RolloutBatch around(const ControlSequence& nominal) const;

  /// Runs a batch and counts its rollouts, also if it fails.
  Result<physics_pool::BatchReply> run(const physics_pool::RolloutBatch& batch);

  /// Runs batches side by side, each in a thread that waits for the pool. Once one is enough those behind it are
  /// cancelled, since nobody will ask for them, and their replies are empty: what is returned does not depend on who
  /// was faster. Counts the rollouts of all.
  Result<std::vector<physics_pool::BatchReply>> run_in_order(std::span<const physics_pool::RolloutBatch> batches);

  /// Whether the winner of a batch is a plan that needs no improvement: at the goal, and not too dear. One of few steps
  /// can be that without the early end of a success, which asks for n_min steps before it.
  bool is_enough(const physics_pool::BatchReply& reply) const;

  /// Keeps the winner of a batch, if it has one.
  void adopt(const physics_pool::RolloutBatch& batch, const physics_pool::BatchReply& reply);

  /// Runs one sequence as it is, and keeps it if it is better.
  Result<void> consider(const ControlSequence& controls);

  /// Scores the initial sequence, then improves it until a success or the last
  /// iteration; tells on_progress after each. What reduced physics calls a success
  /// counts when one rollout with full physics agrees; otherwise it is one more
  /// candidate, at the cost that full physics gives it.
  /// Errors   those of `improve`, and of Planner::plan.
  Result<Plan> until_done(const std::function<Result<void>()>& improve);

  /// Does the same without scoring the initial sequence first: `improve` does what it wants with it.
  Result<Plan> improve_until_done(const std::function<Result<void>()>& improve);

 private:
  Result<void> attempt(const std::function<Result<void>()>& step);
  void report() const;

  physics_pool::Pool& pool_;
  const Problem& problem_;
  physics_pool::RolloutBatch pattern_;
  const TimePoint deadline_;
  const std::stop_token stop_;
  const OnProgress& on_progress_;
  Plan best_;
  std::string divergence_;  // reason of the newest rollout that diverged
};

/// The reply's winner, or nullptr.
const physics_pool::RolloutOutcome* winner_of(const physics_pool::BatchReply& reply);
bool succeeded(const physics_pool::BatchReply& reply);

/// A sample that ran to its end.
struct Scored {
  ControlSequence controls;
  double cost = 0.0;
  std::vector<double> step_costs;  ///< [n]
};

/// Returns the samples that ran to their ends, in sample order.
std::vector<Scored> completed(const physics_pool::RolloutBatch& batch, const physics_pool::BatchReply& reply);

/// Returns the weights exp(-(C_k - min C)/lambda). Taking the smallest cost off changes no ratio and
/// keeps the largest weight at 1.
std::vector<double> exponential_weights(const std::vector<double>& costs, double lambda);

/// Sets step t of `mean` to the weighted mean of the samples' step t.
void average_step(std::span<const Scored> samples, std::span<const double> weights, int t, ControlSequence& mean);

}  // namespace jostle::planners
