#pragma once
/// \file
/// Planning of grasps guided by coarse physics.

#include <memory>
#include <vector>

#include "planners/api/planner.hpp"
#include "planners/guided/forecast.hpp"
#include "planners/pbsto/pbsto.hpp"

namespace jostle::planners {

struct GuidanceOptions {
  /// Candidates per iteration that coarse physics ranks, and up to twice as many while none of them succeeds in it; 0:
  /// no guidance. More find more: a thousand take some 0.2 s of a core.
  int candidates = 0;
  int generations = 3;  ///< that they come in; all but the first are drawn around the best ones, too
  int judged = 2;       ///< of them, the engine judges in an iteration, side by side; more after each denial
  int threads = 0;      ///< that rank; 0: one per processor. Changes no plan.
};

/// An iteration draws candidates of several families (candidates.hpp), ranks them in generations by coarse physics, and
/// has the engine judge the few best that differ and, in the first iteration, the initial sequence, with full physics,
/// in parallel. The engine alone decides: a candidate counts at the cost, and as the success, that the engine gave it.
/// While that denies what coarse physics promised, the next iteration has more of them judged, and draws from states
/// that the engine has been in as well.
///
/// The plan is a pure function of the problem and of the engine's results in the candidates' order; neither clock nor
/// number of threads or workers has a part in it.
///
/// Source   the order of cheap ranking and dear judging: multi-fidelity optimization, e.g. Peherstorfer, Willcox &
///          Gunzburger, "Survey of multifidelity methods", SIAM Review 2018
class GuidedPlanner final : public Planner {
 public:
  /// Keeps a reference to the pool, which must outlive it. `options`: noise, limits, n_min and the length of a step.
  /// Errors   kInvalidArgument  a scene without a hand that moves in the plane and turns, or one that the coarse
  ///                             model cannot show
  static Result<std::unique_ptr<GuidedPlanner>> make(physics_pool::Pool& pool, const physics_pool::Scene& scene,
                                                     const PbstoOptions& options, const GuidanceOptions& guidance,
                                                     OnProgress on_progress = {});

  Result<Plan> plan(const Problem& problem, TimePoint deadline, std::stop_token stop = {}) override;

 private:
  GuidedPlanner(physics_pool::Pool& pool, const physics_pool::Scene& scene, const PbstoOptions& options,
                const GuidanceOptions& guidance, OnProgress on_progress);

  physics_pool::Pool& pool_;
  const physics_pool::TaskGeometry geometry_;
  const PbstoOptions options_;
  const GuidanceOptions guidance_;
  const OnProgress on_progress_;
  std::vector<Forecaster> forecasters_;  // one per thread
};

}  // namespace jostle::planners
