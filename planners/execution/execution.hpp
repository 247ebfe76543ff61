#pragma once
/// \file
/// What every controller does alike: observe, plan, act, tell, keep count.

#include <chrono>
#include <cstdint>
#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "perception/api/object_source.hpp"
#include "physics_pool/task/task_geometry.hpp"
#include "planners/api/planner.hpp"
#include "robot_bridge/api/robot.hpp"

namespace jostle::planners {

/// How long a run may go on, planning and acting together.
struct RunLimits {
  std::chrono::milliseconds timeout{15 * 60 * 1000};
  /// Rollouts of all plans of a run; 0: as many as there is time for. A run that is limited by rollouts, rather than by
  /// time, makes the same decisions however fast its machines are and whoever else uses them.
  std::uint64_t rollouts = 0;
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
  /// Turns an observed state into one that physics can start from; may be empty.
  std::function<Result<State>(const State&)> make_feasible;
  RunLimits limits;
};

/// Phases of a run, for those who watch.
enum class Phase { kPlanning, kActing, kClosing, kDone };

/// How a run ended; the numbers are those of jostle_msgs/msg/GoalResult. A controller gives the first
/// four, and whoever started the controller gives the others.
enum class Ending : std::uint8_t {
  kUnknown = 0,  ///< not over yet, or nobody has said
  kSucceeded = 1,
  kFailed = 2,  ///< it came to an end that was not the wanted one
  kTimedOut = 3,
  kCancelled = 4,
  kBroken = 5,  ///< parts of the system failed
  kRefused = 6  ///< never begun
};

/// Returns words such as "succeeded" or "timed out".
const char* to_string(Ending ending);

struct Outcome {
  Ending ending = Ending::kUnknown;
  bool success = false;  ///< whether `ending` is kSucceeded
  std::string reason;    ///< one sentence
  Plan first_plan;
  int replans = 0;
  int actions = 0;
  /// Over all plans. One that ran out of time counts with every rollout that it asked for, though some of the last
  /// ones may not have been finished.
  std::uint64_t rollouts = 0;
  int iterations = 0;                         ///< over all plans that were finished
  std::vector<Segment> segments;              ///< that a robust plan was divided into, in time order
  int segment = -1;                           ///< index of the one under way, or -1
  int open_loop_actions = 0;                  ///< of `actions`, those that nothing was looked at for
  int mismatches = 0;                         ///< robust segments that began elsewhere than planned, so were not open
  std::chrono::duration<double> plan_time{};  ///< time that the first plan took; 0 if it never came to be
  std::chrono::duration<double> planning_time{};  ///< time that all plans took, with one that ran out of time
  std::chrono::duration<double> total_time{};
  Trajectory observed;  ///< before the first action and after each, and after each rest
  std::vector<std::string> dropped;

  /// Notes how the run ended, and why, in words for people.
  void conclude(Ending how, std::string why);
  bool is_over() const { return ending != Ending::kUnknown; }
};

/// A running controller's news; valid during the call.
struct ControlEvent {
  Phase phase = Phase::kPlanning;
  const Outcome& outcome;           ///< what has come of the run so far; with kDone: of all of it, however it ended
  const Plan* plan = nullptr;       ///< the present plan, once there is one
  const State* observed = nullptr;  ///< newest observation
};
using OnEvent = std::function<void(const ControlEvent&)>;

/// One run of a controller under way: the newest state, the present plan, and what
/// has come of the run so far.
///
/// Threads  one.
/// Errors   kDeadline  the run has taken longer than its time, or needs a plan and has no rollouts left
class Execution {
 public:
  Execution(const ControlSetup& setup, double step_duration, const OnEvent& on_event, std::stop_token stop);

  const StateLayout& layout() const { return setup_.geometry.layout; }
  const physics_pool::Objective& objective() const { return setup_.objective; }
  const State& x() const { return x_; }                                 ///< newest observation
  const robot_bridge::RobotReading& robot() const { return reading_; }  ///< of the same moment
  Outcome& outcome() { return outcome_; }
  const Outcome& outcome() const { return outcome_; }

  /// The present plan: what is left of it, from the newest state on.
  Plan& plan() { return plan_; }
  const Plan& plan() const { return plan_; }
  bool has_planned() const { return planned_; }
  /// Whether nothing of the present plan has been executed.
  bool plan_is_fresh() const { return outcome_.actions == acted_at_plan_; }

  Result<void> observe();

  /// Plans from x(), with fresh noise. `objective`: the setup's, or what a controller makes of it for this plan.
  /// `weigh_robustness`: see Problem.
  Result<void> plan(const ControlSequence& initial, int iterations, const physics_pool::Objective& objective,
                    std::vector<double> u_before = {}, bool weigh_robustness = true);

  /// Executes u_0, removes it and x_0 from the plan, observes.
  Result<void> act();

  /// Applies no control for so long, s, and observes; nothing where it is 0. Called after act(), it belongs to the
  /// action, and what it came to is the state that the rest of the plan starts from.
  Result<void> rest(double duration);

  /// Applies u, which belongs to no plan, and observes.
  Result<void> move(std::span<const double> u, Phase phase);

  /// Ends the run, and tells the watcher. A task that ran out of time is an Outcome, because the system has not
  /// failed; what a run that was stopped or broke has come to is in the last event.
  Result<Outcome> end(const Result<void>& ended);

  void notify(Phase phase) const;

 private:
  std::uint64_t rollouts_left() const;
  void conclude_early(const Error& why);

  using Clock = std::chrono::steady_clock;

  const ControlSetup& setup_;
  const double step_duration_;  // s
  const OnEvent& on_event_;
  const std::stop_token stop_;
  const Clock::time_point start_, deadline_;
  State x_;
  robot_bridge::RobotReading reading_;
  Plan plan_;
  bool planned_ = false;
  bool is_out_of_rollouts_ = false;
  std::uint32_t stream_ = 0;
  int acted_at_plan_ = -1;  // actions executed when the present plan was made
  Outcome outcome_;
};

/// Makes a State from the two ports' readings.
/// Error kInvalidArgument if an object of the layout is missing; names it.
Result<State> assemble_state(const StateLayout& layout, const robot_bridge::RobotReading& robot,
                             const std::vector<perception::ObjectReading>& objects);

}  // namespace jostle::planners
