#pragma once
/// \file
/// Model-predictive control of pushing: plan, execute one action, observe, again.

#include <chrono>
#include <stop_token>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "planners/execution/execution.hpp"

namespace jostle::planners {

struct MpcOptions {
  int horizon = 4;              ///< N, actions of a plan (Sec. 6.3.3)
  int first_iterations = 4;     ///< of the optimizer for the first plan
  int iterations = 2;           ///< for every other; more find more and cost more
  int max_actions = 20;         ///< the task has failed after so many (Sec. 6.3.3)
  double straight_speed = 0.1;  ///< m/s, of the straight push, at most
  double step_duration = 1.0;   ///< Delta_t, s
  bool plan_only = false;       ///< stop after the first plan
};

/// Runs one push task to its end. A task that fails (obstacle hit, object dropped,
/// another object in the goal region, no actions or no time left) is an Outcome; an
/// Error means that the parts of the system failed. Failures and success are judged
/// after every action, by what is observed.
/// Source   Sec. 6.2, 7.3; README.md has the equations.
Result<Outcome> run_mpc(const ControlSetup& setup, const MpcOptions& options, const OnEvent& on_event = {},
                        std::stop_token stop = {});

/// Returns `steps` controls that push the target straight to the centre of its goal
/// region, and no further, if nothing is in the way. A pusher that is not
/// behind the target first goes round it to get there, at `speed` m/s at most.
ControlSequence straight_push(const physics_pool::TaskGeometry& geometry, const State& x, int steps,
                              double step_duration, double speed);

}  // namespace jostle::planners
