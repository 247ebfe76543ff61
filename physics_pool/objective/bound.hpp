#pragma once
/// \file
/// What a rollout that is under way is bound to pay, whatever physics does next.

#include <span>

#include "idl/types/state.hpp"
#include "physics_pool/objective/objective.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::physics_pool {

/// What is certain about a rollout before control step `done`, if all its controls are known.
struct Outlook {
  double cost = 0.0;        ///< at least this is still to come: running costs and goal
  bool may_succeed = true;  ///< the goal can still be reached
};

/// Bounds from below the cost that is still to come. Certain are the changes of control, and that what has
/// dropped stays down. The goal's cost has a bound, too, where a task is done by coming near the target
/// (TaskKind::distance_at_end), as its distance shrinks no faster than hand and target can approach each other. For a
/// hand that moves in the plane:
///
///   d_T(end) >= d_T - sum_s (2·a_s + w_s·(d_T + a_0 + … + a_s) + f_s)·Delta_t
///
/// with a_s the hand's speed in step s, w_s its rate of turning and f_s the speed of
/// a finger, each the larger of what is commanded and what was commanded before (a
/// drive never overshoots). This assumes that the target moves no faster than a point would
/// that is fixed to the hand at the target's distance. A target that is
/// squeezed out of a wedge or flung by a lever could be faster; none of some thousand random
/// pushes was (bound_test.cpp, and equal plans in `jostle bench cheap-physics`).
/// For other robots the fastest of their points stands for the hand, by the reaches of the axes, and for the target:
///
///   d_T(end) >= d_T - sum_s 2·(sum_i |u_i|·r_i)·Delta_t
///
/// Of arms this was tried on the few pushes of the pool's contract suite, and on no random ones.
/// For other tasks the goal's cost has no bound: a pushed target may have been given any speed.
///
/// `u_before`: control before step `done`.
Outlook outlook(const TaskGeometry& geometry, const Objective& objective, const ControlSequence& controls, int done,
                std::span<const double> u_before, const State& x, double step_duration);

}  // namespace jostle::physics_pool
