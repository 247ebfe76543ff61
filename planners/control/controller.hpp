#pragma once
/// \file
/// Controllers: planning and acting until the target is in the hand.

#include <chrono>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "perception/api/object_source.hpp"
#include "physics_pool/objective/terms.hpp"
#include "planners/api/planner.hpp"
#include "robot_bridge/api/robot.hpp"

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
  /// lodged in it: predictions that counted on grasping past it have failed.
  int obstruction_patience = 3;
  int min_steps = 2;         ///< n_min
  /// SD_thresh: largest |x_predicted - x_observed|, over robot joints (m, rad)
  /// and objects (m, and rad of rotation).
  double deviation_threshold = 0.5;
  int initial_steps = 6;       ///< n of the straight line
  double straight_speed = 0.04; ///< m/s of the single straight step
  double step_duration = 1.0;  ///< Delta_t, s
  std::chrono::milliseconds timeout{15 * 60 * 1000};  ///< planning and acting together
  bool plan_only = false;      ///< stop after the first plan
  bool close_hand = true;      ///< close the fingers on the target at the end
};

/// What a controller works with. Everything outlives the run.
struct ControlSetup {
  Planner& planner;
  robot_bridge::Robot& robot;
  perception::ObjectSource& objects;
  const physics_pool::TaskGeometry& geometry;
  physics_pool::Objective objective;
  Hash world;
  std::uint64_t seed = 0;
  /// Makes an observed state one that physics can start from; may be empty.
  std::function<State(const State&)> make_feasible;
};

/// Phases of a run, for those who watch.
enum class Phase { kPlanning, kActing, kClosing, kDone };

/// A running controller's news; valid during the call.
struct ControlEvent {
  Phase phase = Phase::kPlanning;
  int actions = 0;
  int replans = 0;
  const Plan* plan = nullptr;      ///< the present plan, once there is one
  const State* observed = nullptr; ///< newest observation
};
using OnEvent = std::function<void(const ControlEvent&)>;

struct Outcome {
  bool success = false;
  std::string reason;           ///< one sentence
  Plan first_plan;
  int replans = 0;
  int actions = 0;
  std::uint64_t rollouts = 0;   ///< over all plans
  int iterations = 0;           ///< over all plans
  std::chrono::duration<double> plan_time{};   ///< of the first plan
  std::chrono::duration<double> total_time{};
  Trajectory observed;          ///< before the first action and after each
  std::vector<std::string> dropped;
};

/// Runs one task to its end. A task that fails (dropped object, timeout) is an
/// Outcome; an Error means that the parts of the system failed.
/// Source   Alg. 2 and 3, with the success of Sec. 3.3.2: target in the
///          pre-grasp region and no object dropped.
Result<Outcome> run_controller(const ControlSetup& setup, const ControlOptions& options,
                               const OnEvent& on_event = {}, std::stop_token stop = {});

/// U of `steps` equal controls that would bring the hand straight to its
/// pre-grasp distance from the target if nothing were in the way.
ControlSequence straight_line(const physics_pool::TaskGeometry& geometry, const State& x, int steps,
                              double step_duration);

/// |a - b| over robot joints and object poses, in m and rad.
double state_deviation(const StateLayout& layout, const State& a, const State& b);

/// A State from the two ports' readings.
/// Error kInvalidArgument if an object of the layout is missing; names it.
Result<State> assemble_state(const StateLayout& layout, const robot_bridge::RobotReading& robot,
                             const std::vector<perception::ObjectReading>& objects);

}  // namespace jostle::planners
