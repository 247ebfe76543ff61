#pragma once
/// \file
/// What every controller does alike: observe, plan, act, tell, keep count.

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "perception/api/object_source.hpp"
#include "physics_pool/task/task_geometry.hpp"
#include "planners/api/planner.hpp"
#include "planners/execution/plan_ahead.hpp"
#include "robot_bridge/api/robot.hpp"

namespace jostle::planners {

/// How long a run may go on, planning and acting together.
struct RunLimits {
  std::chrono::milliseconds timeout{15 * 60 * 1000};
  /// Rollouts of all plans of a run; 0: as many as there is time for. A run that is limited by rollouts, rather than by
  /// time, makes the same decisions however fast its machines are and whoever else uses them.
  std::uint64_t rollouts = 0;
};

/// One action, in the planning world.
struct ActionAhead {
  State x;                ///< from where
  ControlSequence u;      ///< one step
  double duration = 0.0;  ///< s
  double rest = 0.0;      ///< s without control after it
};

/// Where a plan began.
struct PlanOrigin {
  /// It was made during the newest action, from the state that the action was predicted to come to.
  bool while_acting = false;
  /// m, of what was observed from what was predicted: see state_distance. Where it was too far, the plan was made anew.
  /// Nothing: no plan was made while acting.
  std::optional<double> deviation;
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
  /// Plans of the next action are made while the present one is at work, and taken where the robot and all objects are
  /// observed this near to what was predicted, m (state_distance); 0: plans are made while the robot stands still. A
  /// larger one makes the robot stand still less, and act on plans for states further off.
  double plan_while_acting = 0.0;
  /// Says what an action comes to; wanted where plan_while_acting is set. Called from a thread of Execution's.
  std::function<Result<State>(const ActionAhead&, TimePoint deadline, std::stop_token)> predict;
  /// Told of every plan that is taken up, and of what it solves; may be empty. Called on the controller's thread.
  std::function<void(const Problem&, const Plan&, const PlanOrigin&)> on_plan;
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
  kBroken = 5,   ///< parts of the system failed
  kRefused = 6,  ///< never begun
  kInvalid = 7   ///< never begun: the goal is malformed, or for another scene than the world's
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
  /// Time that all plans were waited for, with one that ran out of time.
  std::chrono::duration<double> planning_time{};
  std::chrono::duration<double> total_time{};
  /// s that the robot stood still before each action that was begun, but for its rests: before the first one for the
  /// first plan, before others for observing and for plans.
  std::vector<double> idle;
  int plans_ahead = 0;  ///< that were begun while acting
  int taken_ahead = 0;  ///< of those, that were taken
  /// Of plans that were begun while acting and not taken; how far they got is a matter of time. `rollouts` and its
  /// limit are without them.
  std::uint64_t abandoned_rollouts = 0;
  Trajectory observed;  ///< before the first action and after each, and after each rest
  std::vector<std::string> dropped;

  /// Notes how the run ended, and why, in words for people.
  void conclude(Ending how, std::string why);
  bool is_over() const { return ending != Ending::kUnknown; }
};

/// Returns Outcome::idle without what was before the first action.
std::vector<double> idle_between(const Outcome& outcome);

/// A running controller's news; valid during the call.
struct ControlEvent {
  Phase phase = Phase::kPlanning;
  const Outcome& outcome;           ///< what has come of the run so far; with kDone: of all of it, however it ended
  const Plan* plan = nullptr;       ///< the present plan, once there is one
  const State* observed = nullptr;  ///< newest observation
};
using OnEvent = std::function<void(const ControlEvent&)>;

/// What a controller wants to be planned.
struct PlanRequest {
  ControlSequence initial;            ///< candidate to improve
  int iterations = 0;                 ///< at most
  physics_pool::Objective objective;  ///< the setup's, or what the controller makes of it for this plan
  std::vector<double> u_before;       ///< [nu] control before the candidate's first step; empty: at rest
  bool weigh_robustness = true;       ///< see Problem
};

/// Says what a controller will want to be planned if the action at work comes to state `x`; nothing where it will plan
/// nothing from there, as the task is over then or the plan good enough. `left`: what is left of the present plan after
/// the action; its first state is what the plan itself predicts.
using NextRequest = std::function<std::optional<PlanRequest>(const State& x, const Plan& left)>;

/// One run of a controller under way: the newest state, the present plan, and what
/// has come of the run so far.
///
/// Where the setup asks for it, the next plan is made while the robot acts (`PlanAhead`):
///
///   x^     = f(x, u)                           predicted when the action begins, from what was observed then
///   plan   = that of `next(x^)`                made while the action is at work
///   taken  if d(x_observed, x^) <= plan_while_acting; else plan(request) makes one anew, from x_observed
///
/// A plan has the noise of its number, whenever it is made. So decisions depend on seed, indices and observed states
/// alone, and are those of a robot that waits wherever prediction and observation are equal, or no plan is taken.
///
/// Threads  one. `next` may be called from another one, while the controller's is inside act().
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

  /// Whether the task has ended, and then concludes it: something was dropped, it failed or was achieved as its kind
  /// says, or so many actions did not achieve it.
  bool is_over(int max_actions);
  /// Names of the objects that are dropped in state x.
  std::vector<std::string> dropped_in(const State& x) const;
  /// Whether it will have, if the action at work comes to state `x`.
  bool will_be_over(const State& x, int max_actions) const;

  /// Plans from x(), with fresh noise; or takes the plan that was made while acting, if x() is near where that begins.
  Result<void> plan(const PlanRequest& request);

  /// Executes u_0, removes it and x_0 from the plan, observes. With a rest, s, no control is applied for so long then,
  /// and what that came to is observed as well: it belongs to the action, and the rest of the plan starts from there.
  /// `next`: what the controller will ask plan() for after this action; empty: it cannot say.
  Result<void> act(double rest = 0.0, const NextRequest& next = {});

  /// Applies u, which belongs to no plan, and observes.
  Result<void> move(std::span<const double> u, Phase phase);

  /// Ends the run, and tells the watcher. A task that ran out of time is an Outcome, because the system has not
  /// failed; what a run that was stopped or broke has come to is in the last event.
  Result<Outcome> end(const Result<void>& ended);

  void notify(Phase phase) const;

 private:
  using Clock = std::chrono::steady_clock;

  std::uint64_t rollouts_left() const;
  void conclude_early(const Error& why);
  void judge(const State& x, int max_actions, Outcome& outcome) const;
  Problem blank_problem() const;
  static Result<Problem> filled(Problem blank, const ControlSetup& setup, const State& x, const PlanRequest& request);
  Result<void> plan_anew(const PlanRequest& request, PlanOrigin origin);
  std::optional<double> deviation_of_ahead() const;
  bool take_ahead(PlanOrigin& origin);
  void adopt(const Problem& problem, Plan plan, const PlanOrigin& origin);
  void plan_ahead(double rest, const NextRequest& next);
  void drop_ahead();
  Result<void> perform(std::span<const double> u, double duration);

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
  Clock::time_point still_since_;
  std::chrono::duration<double> still_{};  // that the robot stood since the newest action of a plan
  Outcome outcome_;
  std::unique_ptr<PlanAhead> ahead_;  // last: its thread uses the others
};

/// Makes a State from the two ports' readings.
/// Error kInvalidArgument if an object of the layout is missing; names it.
Result<State> assemble_state(const StateLayout& layout, const robot_bridge::RobotReading& robot,
                             const std::vector<perception::ObjectReading>& objects);

}  // namespace jostle::planners
