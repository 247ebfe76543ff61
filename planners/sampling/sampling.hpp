#pragma once
/// \file
/// The peers of PBSTO: four update rules of sampling-based planning, for
/// comparison on the same engine, budget and seeds.

#include <vector>

#include "planners/api/planner.hpp"

namespace jostle::planners {

struct SamplingOptions {
  enum class Method {
    /// Predictive sampling: the cheapest of the candidate and K samples around it
    /// becomes the candidate.
    kPredictive,
    /// MPPI: the candidate becomes the mean of all samples, weighted with
    /// exp(-(S_k - min S)/lambda), S_k the total cost.
    kMppi,
    /// Cross-entropy method: candidate and sigma are fitted to the cheapest samples.
    kCem,
    /// CEM with correlated noise, some elites kept for the next iteration and
    /// ever smaller batches.
    kIcem,
  };

  Method method = Method::kPredictive;
  int rollouts = 8;  ///< K per iteration, >= 1; more find more and cost more
  /// [nu] standard deviations of the noise on x, y [m/s], rotation [rad/s] and
  /// opening [m/s]; for kCem and kIcem, those of the first iteration.
  std::vector<double> sigma{0.04, 0.04, 0.25, 0.004};
  std::vector<double> limit{0.15, 0.15, 0.8, 0.05};  ///< [nu] largest controls, same units
  double lambda = 100.0;                             ///< kMppi: lambda as above, units of cost, > 0; small is greedy
  /// kCem and kIcem: the part of K that a fit is made to, in (0, 1], rounded up;
  /// a larger one converges later, and less often to the wrong place.
  double elites = 0.25;
  /// kCem and kIcem: the part of the old candidate and the old sigma that a fit
  /// leaves, in [0, 1); more is steadier and slower.
  double smoothing = 0.1;
  /// kCem and kIcem: the least sigma, as a part of the first one, in [0, 1]; above 0
  /// the search never freezes.
  double sigma_floor = 0.1;
  double persistence = 0.7;  ///< kIcem: SamplingLaw::persistence, in [0, 1); the others' noise is white
  /// kIcem: the part of the elites that compete again in the next iteration, in
  /// [0, 1], rounded up. Physics repeats itself, so they cost no rollout.
  double kept = 0.3;
  /// kIcem: iteration i draws K·decay^i samples, decay in (0, 1], and no fewer than
  /// twice the elites.
  double decay = 0.8;
  int min_steps = 2;           ///< n_min of Alg. 1
  double step_duration = 1.0;  ///< Delta_t, s
  bool stop_losers = true;     ///< where the update allows it; never changes the plan, only its price
  physics_pool::Fidelity fidelity;
};

/// A SamplingPlanner returns the cheapest sequence that was ever scored. After every update of
/// kMppi and kCem that is no success, the candidate itself is scored, which takes
/// one more rollout; kIcem executes its best elite and needs none.
///
/// Source   kPredictive  Howell et al., "Predictive Sampling: Real-time Behaviour
///                       Synthesis with MuJoCo", 2022
///          kMppi        Williams et al., "Information Theoretic MPC for
///                       Model-Based Reinforcement Learning", ICRA 2017, without
///                       the term lambda·u·Sigma^-1·noise in S: the acceleration
///                       cost is the only price of a control here
///          kCem         Rubinstein, "The Cross-Entropy Method for Combinatorial
///                       and Continuous Optimization", 1999
///          kIcem        Pinneri et al., "Sample-efficient Cross-Entropy Method for
///                       Real-time Planning", CoRL 2020. The noise is an AR(1)
///                       process, not one with a power-law spectrum; it is scaled
///                       before and clamped after as in SamplingLaw; the mean does
///                       not join the last iteration, because any may be the last:
///                       a success ends the search.
class SamplingPlanner final : public Planner {
 public:
  /// Keeps a reference to the pool, which must outlive it.
  SamplingPlanner(physics_pool::Pool& pool, SamplingOptions options, OnProgress on_progress = {});

  Result<Plan> plan(const Problem& problem, TimePoint deadline, std::stop_token stop = {}) override;

 private:
  physics_pool::Pool& pool_;
  SamplingOptions options_;
  OnProgress on_progress_;
};

}  // namespace jostle::planners
