#pragma once
/// \file
/// Controllers: planning and acting until the target is in the hand.

#include <chrono>
#include <stop_token>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "planners/execution/execution.hpp"

namespace jostle::planners {

struct ControlOptions {
  enum class Method {
    kOnline,  ///< OR, Alg. 2: re-plans briefly whenever the world deviates
    kNaive,   ///< NR, Alg. 3: executes a whole plan, then plans anew
  };

  Method method = Method::kOnline;
  int many_iterations = 50;  ///< ManyIter
  int few_iterations = 1;    ///< FewIter
  /// FewIter doubles after every re-plan in a row that does not reach the
  /// target, up to this: brief while it suffices, thorough once the hand is
  /// stuck. Equal to few_iterations it is Alg. 2 to the letter.
  int few_iterations_max = 8;
  /// After so many re-plans in a row, plans must also clear the hand of what has
  /// lodged in it, because predictions that counted on grasping past it have failed.
  int obstruction_patience = 3;
  int min_steps = 2;  ///< n_min
  /// SD_thresh: largest |x_predicted - x_observed|, over robot joints (m, rad)
  /// and objects (m, and rad of rotation).
  double deviation_threshold = 0.5;
  int initial_steps = 6;         ///< n of the straight line
  double straight_speed = 0.04;  ///< m/s of the single straight step
  double step_duration = 1.0;    ///< Delta_t, s
  bool plan_only = false;        ///< stop after the first plan
  bool close_hand = true;        ///< close the fingers on the target at the end
};

/// Runs one task to its end. A task that fails (dropped object, timeout) is an
/// Outcome; an Error means that the parts of the system failed.
/// Source   Alg. 2 and 3, with the success of Sec. 3.3.2: target in the
///          pre-grasp region and no object dropped.
Result<Outcome> run_controller(const ControlSetup& setup, const ControlOptions& options, const OnEvent& on_event = {},
                               std::stop_token stop = {});

/// Returns `steps` equal controls that would bring the hand straight to its
/// pre-grasp distance from the target if nothing were in the way.
ControlSequence straight_line(const physics_pool::TaskGeometry& geometry, const State& x, int steps,
                              double step_duration);

/// Returns |a - b| over robot joints and object poses, in m and rad.
double state_deviation(const StateLayout& layout, const State& a, const State& b);

}  // namespace jostle::planners
