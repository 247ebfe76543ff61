#pragma once
/// \file
/// The controllers of Chapter 5: decide, act, let things come to rest, observe, decide again.

#include <stop_token>

#include "idl/types/result.hpp"
#include "planners/adaptive/adaptive_planner.hpp"
#include "planners/execution/execution.hpp"

namespace jostle::planners {

/// The options of the two baselines of Sec. 5.5, from those of task-adaptive control: the same solver with slow
/// candidates only (UAMPC), and one slow candidate that no noise judges (MPC).
AdaptiveOptions slow_only(AdaptiveOptions options);
AdaptiveOptions standard_mpc(AdaptiveOptions options);

/// Runs one task to its end (the loop of Alg. 6): plans, executes the first action and then no control for `rest`
/// seconds, keeps what is left of the plan as one of the next candidates. The setup's planner is an AdaptivePlanner
/// with the same options, or stands in front of one.
///
/// Success and failure are judged after every rest, by what is observed. A task that fails (something dropped, an
/// obstacle hit, another object in the goal region, no actions or no time left) is an Outcome; an Error means that the
/// parts of the system failed.
Result<Outcome> run_adaptive(const ControlSetup& setup, const AdaptiveOptions& options, const OnEvent& on_event = {},
                             std::stop_token stop = {});

}  // namespace jostle::planners
