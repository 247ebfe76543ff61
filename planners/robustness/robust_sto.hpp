#pragma once
/// \file
/// Robust sampling-based trajectory optimization (Alg. 5).

#include "physics_pool/task/task_geometry.hpp"
#include "physics_pool/uncertainty/realizations.hpp"
#include "planners/api/planner.hpp"
#include "planners/pbsto/pbsto.hpp"
#include "planners/robustness/segments.hpp"

namespace jostle::planners {

struct RobustStoOptions {
  /// Whose deviations metrics are made of (Sec. 8.1.5).
  enum class Judged {
    kAll,     ///< all objects, as the thesis's norm over the whole state has it
    kTarget,  ///< the target alone
    kMoved,   ///< the target, and what the planned trajectory itself moves by 1 mm or more
  };

  int starts = 4;  ///< N_c; 0 leaves robustness out of everything: then J_R is J
  int worlds = 4;  ///< N_w, realizations beside the nominal world; 0 leaves E^f, the metric of prior work
  physics_pool::StartSpread spread;
  physics_pool::ParameterBounds bounds;
  Judged judged = Judged::kAll;
  double expected_weight = 2.0;  ///< v_e
  double maximal_weight = 0.5;   ///< v_m
  double cost_weight = 1.0;      ///< v_j, > 0
  double terminal_cost = 10.0;   ///< alpha of Eq. 4.31, compared with the weighted final cost
  /// How far above 1 a metric may be of what still counts as robust. What nothing touches has a metric of 1 but for the
  /// engine's settling.
  double tolerance = 0.01;
  GraphCosts graph;

  bool operator==(const RobustStoOptions&) const = default;
};

/// RobustSto improves a candidate by J_R, greedily.
///
///   J_R = v_e·E_e + v_m·E_m + v_j·J          Eq. 4.28; E the largest over the N_w + 1 worlds (Eq. 4.23)
///   J   = the problem's objective            Eq. 4.29
///
///   feasible   final cost of x_N at most alpha (Eq. 4.31), controls within their limits (Eq. 4.32, by clamping),
///              and J at most beta, the objective's success_cost
///   ends       once the candidate is feasible and E_e <= 1 + tolerance, or after I_max iterations
///
/// An iteration is one run_all() of (N_c·(N_w + 1) + 1)·S rollouts: S noisy copies U^s from x0 in the planning world,
/// and the same copies from N_c starts beside x0 in each of the N_w + 1 worlds. Worlds and starts are drawn by the
/// problem's seed alone, so all candidates of a plan meet the same ones: otherwise a greedy choice is one of luck.
///
/// Where we differ from the thesis:
/// * I_max iterations and not I_max + 1, as Eq. 4.42 counts them.
/// * Deviations are from the planned trajectory in every world, because Eq. 4.42 counts no other. So in a realization
/// they
///   have in them what its other parameters do to the trajectory itself.
/// * With the optimizer's `freeze` what rests has no freedom until it is touched, in all rollouts alike; then the
/// metric of
///   what nothing touches is exactly 1.
/// * The vector that goes into the graph has the metrics of every world; a segment is as bad as in its worst world.
///
/// `Plan::cost` is J_R, Problem::weigh_robustness off gives a plan by J alone ("a version of Alg. 5 without robustness
/// computations", Sec. 4.4.4).
///
/// Repeats  equal problems give bit-equal plans on any pool
/// Errors   those of Planner::plan and of Pool::load
class RobustSto final : public Planner {
 public:
  /// Keeps references to pool, scene and geometry, which must outlive it. `scene`: the planning world. `optimizer`
  /// gives S (rollouts), nu (sigma), limits, scales, persistence and Delta_t.
  RobustSto(physics_pool::Pool& pool, const physics_pool::Scene& scene, const physics_pool::TaskGeometry& geometry,
            PbstoOptions optimizer, RobustStoOptions options, OnProgress on_progress = {});

  Result<Plan> plan(const Problem& problem, TimePoint deadline, std::stop_token stop = {}) override;

 private:
  physics_pool::Pool& pool_;
  const physics_pool::Scene& scene_;
  const physics_pool::TaskGeometry& geometry_;
  PbstoOptions optimizer_;
  RobustStoOptions options_;
  OnProgress on_progress_;
};

}  // namespace jostle::planners
