#pragma once
/// \file
/// A planner that begins where coarse physics has found a way.

#include <memory>

#include "planners/guided/guided.hpp"

namespace jostle::planners {

/// Has a GuidedPlanner improve the initial sequence first, for the task's own objective and by a few iterations, and
/// gives what it found to a planner that improves it by its own measure. For planners that search near what they begin
/// with: noise on a straight line finds no way round an object.
///
/// What the guide finds may have fewer steps; a robot at rest fills it up. Plans towards a given state (Eq. 4.41) are
/// begun as they are, for the guide knows one goal, the task's. Rollouts and iterations of both are counted.
///
/// Repeats  equal problems give equal plans, as far as the planner behind it promises that
class GuidedStart final : public Planner {
 public:
  GuidedStart(std::unique_ptr<GuidedPlanner> guide, std::unique_ptr<Planner> planner)
      : guide_(std::move(guide)), planner_(std::move(planner)) {}

  Result<Plan> plan(const Problem& problem, TimePoint deadline, std::stop_token stop = {}) override;

 private:
  std::unique_ptr<GuidedPlanner> guide_;
  std::unique_ptr<Planner> planner_;
};

/// Plans as `planner` does, but from `initial`, which a guide came to with `way`: no control fills it up to the length
/// of the problem's own, and what `way` took counts towards the problem's rollouts and the plan's. Errors   the
/// planner's
Result<Plan> plan_from(Planner& planner, const Problem& problem, ControlSequence initial, const Plan& way,
                       TimePoint deadline, std::stop_token stop);

}  // namespace jostle::planners
