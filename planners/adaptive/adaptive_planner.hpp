#pragma once
/// \file
/// Task-adaptive planning: actions of several speeds, each judged by what noise makes of it (Alg. 6, 8 to 10).

#include "physics_pool/task/task_geometry.hpp"
#include "planners/api/planner.hpp"
#include "planners/pbsto/pbsto.hpp"

namespace jostle::planners {

struct AdaptiveOptions {
  /// What stands for the value of the state after an action.
  enum class Value {
    /// Sum of the costs from the second action on; where there is none, the terminal costs of the very state that a
    /// sample came to. So Eq. 5.3 has it.
    kNext,
    /// Line 9 of Alg. 6 as printed: the sum from the first action on, which counts the first action twice.
    kPrinted,
  };

  int sequences = 6;      ///< N, candidates of a decision, >= 1; more speeds, and as many times the rollouts
  int least_actions = 1;  ///< n_min of Alg. 7, the fastest candidate's
  int most_actions = 10;  ///< n_max of Alg. 7, the slowest candidate's, which is meant to be quasi-static
  int samples = 8;        ///< Q, noisy rollouts of each candidate's first action; 0 judges by the plans alone
  int iterations = 2;     ///< I_max of Alg. 9; more bend candidates further, at K rollouts each
  double noise = 0.075;   ///< b of Eq. 5.10, as the planner believes it to be, >= 0
  double rest = 0.5;      ///< t_rest after every action, s, >= 0
  Value value = Value::kNext;
  double step_duration = 1.0;  ///< Delta_t, s
  int max_actions = 60;        ///< the task has failed after so many
  bool plan_only = false;      ///< stop after the first decision

  bool operator==(const AdaptiveOptions&) const = default;
};

/// AdaptivePlanner makes one decision of the online MDP solver.
///
///   U^i       = action_sequences(x_0), and Problem::initial last (line 15 of Alg. 6)
///   U^i*, C^i = optimized by itself: K noisy copies per iteration, greedy or cost-weighted (Eq. 5.7, 5.8), until the
///               cost is at most C_thresh or I_max is reached (Alg. 9, 10)
///   V^i       = 1/Q sum_q [ L(x_0, x_1^q, U^i*[0]) + V~^i ]      x_1^q = f(x_0, U^i*[0]) with noise (Eq. 5.9)
///   plan      = U^i* of the least V^i
///
/// The costs are those of the problem's objective, whose terminal terms are w_f·L_f. The plan's cost is V^i. Its
/// `choices` say what the first actions were found to be worth.
///
/// Where we differ from the thesis:
/// * V~ is AdaptiveOptions::Value.
/// * C_thresh (Objective::success_cost) is compared with the cost without k_act: a sequence of n actions pays n·k_act
///   whatever it does, and nothing is gained by improving it.
/// * U* is the cheapest sequence ever rolled out; Alg. 9 returns its last try even where line 9 refused it.
/// * All candidates meet the same Q noises, and those of the next decision are others.
/// * A candidate of which a sample diverges is worth nothing.
///
/// Differs from other planners: `Problem::initial` may have no step, and `Problem::iterations` is not
/// looked at but for the streams of noise, of which one is used per iteration.
///
/// Source   Alg. 6 to 10, Eq. 5.3 to 5.10
/// Repeats  equal problems give bit-equal plans on any pool
/// Errors   those of Planner::plan
class AdaptivePlanner final : public Planner {
 public:
  /// Keeps references to pool and geometry, which must outlive it. `optimizer` gives K, sigma, limits, scales,
  /// persistence, update and lambda.
  AdaptivePlanner(physics_pool::Pool& pool, const physics_pool::TaskGeometry& geometry, PbstoOptions optimizer,
                  AdaptiveOptions options, OnProgress on_progress = {});

  Result<Plan> plan(const Problem& problem, TimePoint deadline, std::stop_token stop = {}) override;

 private:
  physics_pool::Pool& pool_;
  const physics_pool::TaskGeometry& geometry_;
  PbstoOptions optimizer_;
  AdaptiveOptions options_;
  OnProgress on_progress_;
};

}  // namespace jostle::planners
