#pragma once
/// \file
/// The controllers of Chapter 4: open loop, closed loop, and both interleaved.

#include <stop_token>

#include "idl/types/result.hpp"
#include "planners/execution/execution.hpp"
#include "planners/robustness/robust_sto.hpp"

namespace jostle::planners {

struct RobustControlOptions {
  enum class Method {
    kOpenLoop,     ///< OL, ROL, CP: executes a whole plan without looking; they differ in what they plan with
    kClosedLoop,   ///< CC: plans, executes one action, looks, plans again
    kInterleaved,  ///< OCL, Alg. 4: robust segments of a plan open-loop, the others closed-loop
  };

  Method method = Method::kInterleaved;
  RobustStoOptions planner;
  int horizon = 5;      ///< N, actions of a plan
  int iterations = 10;  ///< I_max of the first plan
  /// I_max of every other plan, while the robot waits; more find more and cost more.
  int mpc_iterations = 4;
  /// CC fails after so many actions; so does OCL within its last segment.
  int max_actions = 20;
  /// m (`state_distance`). Closed-loop control has brought a segment to its end once the state is no further than this
  /// from the planned one; and a robust segment is executed open-loop only from a state as near as this.
  double interface_distance = 0.03;
  double step_duration = 1.0;  ///< Delta_t, s
  bool plan_only = false;      ///< stop after the first plan

  bool operator==(const RobustControlOptions&) const = default;
};

/// What the five methods of Sec. 4.5 make of the same options.
RobustControlOptions open_loop(RobustControlOptions options);         ///< OL: J alone
RobustControlOptions robust_open_loop(RobustControlOptions options);  ///< ROL: E^r
RobustControlOptions convergent(RobustControlOptions options);        ///< CP: E^f, no other worlds
RobustControlOptions closed_loop(RobustControlOptions options);       ///< CC: J alone
RobustControlOptions interleaved(RobustControlOptions options);       ///< OCL: E^r

/// Runs one task of reaching to its end, the setup's planner being a RobustSto with the same options, or standing in
/// front of one. Success is a target in the pre-grasp region at the end, no other object in the hand, none dropped; the
/// fingers do not close. A task that fails is an Outcome; an Error means that the parts of the system failed.
///
/// OCL, where Alg. 4 leaves it open:
/// * A robust segment [i, j] begins only from a state within `interface_distance` of X*_i; otherwise it is executed
///   closed-loop, and counted (Outcome::mismatches).
/// * Closed-loop control over [i, j] plans by J with x^d = X*_j (Eq. 4.41), over what is left of the segment and never
/// over
///   less than one action. It ends at X*_j, or after 2·(j - i) actions.
/// * The last segment has no X*_j but the task's own goal, and ends there or after max_actions.
///
/// Source   Alg. 4, Sec. 4.4.4, 4.5.2
Result<Outcome> run_robust(const ControlSetup& setup, const RobustControlOptions& options, const OnEvent& on_event = {},
                           std::stop_token stop = {});

}  // namespace jostle::planners
