#pragma once
/// \file
/// Coarse physics for a hand that an arm holds.

#include <memory>

#include "planners/guided/guided.hpp"

namespace jostle::planners {

/// Returns the scene as the planar gripper sees it that is where an arm's hand is: it has the same palm and fingers,
/// and of the arm only what is straight behind the hand. `q`: joints of the arm. Error kInvalidArgument: a robot
/// without a hand, or one that moves in the plane by itself
Result<physics_pool::Scene> shadow_of(const physics_pool::Scene& scene, std::span<const double> q);

/// Begins plans of an arm as GuidedStart begins those of a planar hand. The guide plans for the arm's shadow, the
/// planar gripper that is where the hand is, and the hand is led level over the places that the shadow came to. What
/// guides the plan is a guess, as everywhere; the planner behind it has the engine judge the arm itself, with all its
/// links.
///
/// Plans towards a given state (Eq. 4.41) are begun as they are. Rollouts and iterations of both planners are counted.
///
/// Repeats  equal problems give equal plans, as far as the planner behind it promises that
/// Errors   those of Pool::load, and of both planners
class ArmStart final : public Planner {
 public:
  /// Keeps references to pool, scene and geometry, which must outlive it. `options`: of the arm's planner; the shadow
  /// takes the length of its steps.
  /// Errors   those of shadow_of and of GuidedPlanner::make
  static Result<std::unique_ptr<ArmStart>> make(physics_pool::Pool& pool, const physics_pool::Scene& scene,
                                                const physics_pool::TaskGeometry& geometry, const PbstoOptions& options,
                                                const GuidanceOptions& guidance, std::unique_ptr<Planner> planner);

  Result<Plan> plan(const Problem& problem, TimePoint deadline, std::stop_token stop = {}) override;

 private:
  ArmStart(const physics_pool::TaskGeometry& geometry, physics_pool::Scene shadow, Hash world, double step_duration,
           std::unique_ptr<GuidedPlanner> guide, std::unique_ptr<Planner> planner);

  Problem shadow_problem(const Problem& problem) const;

  const physics_pool::TaskGeometry& geometry_;
  const physics_pool::Scene shadow_;
  const Hash world_;  // of the shadow, in the pool
  const double step_duration_;
  std::unique_ptr<GuidedPlanner> guide_;
  std::unique_ptr<Planner> planner_;
};

}  // namespace jostle::planners
