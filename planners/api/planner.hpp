#pragma once
/// \file
/// Planner: state in, plan out. Planners see a Pool, never an engine or a wire.

#include <cstdint>
#include <functional>
#include <optional>
#include <stop_token>
#include <vector>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "physics_pool/api/pool.hpp"
#include "planners/api/robustness.hpp"

namespace jostle::planners {

using physics_pool::TimePoint;

/// What is to be planned.
struct Problem {
  Hash world;  ///< planning world, known to the pool
  State x0;
  ControlSequence initial;       ///< candidate to improve, at least one step; planners that make their own need none
  std::vector<double> u_before;  ///< [nu] control before the candidate's first step; empty: at rest
  int iterations = 50;           ///< I_max
  /// No iteration begins once so many rollouts are spent; the last one may go beyond it.
  std::uint64_t rollouts = UINT64_MAX;
  std::uint64_t seed = 0;
  std::uint32_t stream = 0;  ///< first noise stream; one is used per iteration
  physics_pool::Objective objective = physics_pool::Objective::standard();
  /// Planners that weigh robustness leave it out of this plan where it is false: then they plan with J of Eq. 4.29
  /// alone.
  bool weigh_robustness = true;
  physics_pool::Priority priority = physics_pool::Priority::kNormal;  ///< of its rollouts; changes no plan
  /// Where the planner counts rollouts when it asks for them, so that those of a plan that fails are known as well;
  /// null: nowhere. Whoever sets it keeps it until the planner returns.
  std::uint64_t* rollouts_asked_for = nullptr;
};

/// An action that was considered first, and what it was found to be worth.
struct Choice {
  int actions = 0;      ///< of the sequence that begins with it
  double speed = 0.0;   ///< m/s, of the robot in the plane
  double value = 0.0;   ///< expected cost, of the action and of all that follows; less is better
  double spread = 0.0;  ///< standard deviation of that over the noises that were tried

  bool operator==(const Choice&) const = default;
};

/// The best sequence found, even if it does not reach the goal.
struct Plan {
  ControlSequence controls;  ///< u_0 … u_{n-1}
  Trajectory states;         ///< x_0 … x_n, predicted
  double cost = physics_pool::kInfinity;
  /// Whether the task's goal is predicted to be reached at x_n, at a cost so low (success_cost) that nothing
  /// failed on the way.
  bool at_goal = false;
  int iterations = 0;
  std::uint64_t rollouts = 0;
  int denials = 0;                       ///< successes of reduced physics that full physics denied
  std::vector<Choice> choices;           ///< of planners that choose among several first actions
  int chosen = -1;                       ///< index into choices
  std::optional<Robustness> robustness;  ///< of planners that weigh it
};

/// Progress of a running plan, once per iteration.
struct Progress {
  int iteration = 0;  ///< 0: the initial candidate was scored
  double cost = 0.0;  ///< of the best sequence so far
  bool at_goal = false;
  std::uint64_t rollouts = 0;          ///< in this plan so far
  const State* final_state = nullptr;  ///< of the best sequence; valid during the call
};
using OnProgress = std::function<void(const Progress&)>;

/// A Planner improves a candidate sequence of controls.
///
/// Repeats  equal problems give bit-equal plans on any pool.
/// Errors   those of Pool::run
///          kInvalidArgument  every rollout from x0 diverged; says why
class Planner {
 public:
  virtual ~Planner() = default;
  virtual Result<Plan> plan(const Problem& problem, TimePoint deadline, std::stop_token stop = {}) = 0;
};

}  // namespace jostle::planners
