#pragma once
/// \file
/// Physics-based stochastic trajectory optimization: Alg. 1 (PBSTO) and the
/// update rules of Eq. 5.7 and 5.8.

#include "planners/api/planner.hpp"

namespace jostle::planners {

struct PbstoOptions {
  enum class Update {
    kGreedy,        ///< the cheapest sample becomes the candidate (Eq. 5.7)
    kCostWeighted,  ///< samples averaged with weights exp(-C/lambda) (Eq. 5.8)
  };

  int rollouts = 8;  ///< K per iteration; more find more and cost more
  /// Standard deviations of the noise on x, y [m/s], rotation [rad/s] and
  /// opening [m/s].
  std::vector<double> sigma{0.04, 0.04, 0.25, 0.004};
  std::vector<double> limit{0.15, 0.15, 0.8, 0.05};  ///< largest controls, same units
  /// Factors of sigma dealt out to the K samples in turn. Small ones first: of
  /// several samples that succeed the one with the lowest index is taken.
  std::vector<double> scales{0.125, 0.25, 0.5, 1.0};
  double persistence = 0.0;  ///< how much of the noise the next step keeps, in [0, 1) (SamplingLaw)
  Update update = Update::kGreedy;
  double lambda = 100.0;       ///< of Eq. 5.8, in units of cost; small is greedy
  int min_steps = 2;           ///< n_min of Alg. 1
  double step_duration = 1.0;  ///< Delta_t, s
  bool stop_losers = true;     ///< never changes the plan, only its price
  bool stop_hopeless = false;  ///< stop losers sooner still, on the assumption of objective/bound.hpp
  bool freeze = false;         ///< objects at rest have no freedom until touched (Fidelity)
  /// How many candidates are screened for each of the K rollouts: K·screening are drawn and run
  /// with long steps, the K cheapest again with the fine model, and the choice is
  /// made among those. 1 screens nothing.
  int screening = 1;
  double screening_time_step = 0.005;  ///< s; longer is cheaper and ranks worse
};

class Pbsto final : public Planner {
 public:
  /// Keeps a reference to the pool, which must outlive it.
  Pbsto(physics_pool::Pool& pool, PbstoOptions options, OnProgress on_progress = {});

  Result<Plan> plan(const Problem& problem, TimePoint deadline, std::stop_token stop = {}) override;

 private:
  physics_pool::Pool& pool_;
  PbstoOptions options_;
  OnProgress on_progress_;
};

}  // namespace jostle::planners
