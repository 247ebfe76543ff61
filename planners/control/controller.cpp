#include "planners/control/controller.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "physics_pool/scene/planar_gripper.hpp"

namespace jostle::planners {
namespace {

using std::chrono::steady_clock;
namespace hand = physics_pool::planar_gripper;

struct Step {
  double dx = 0.0, dy = 0.0;  // m, world frame
  double turn = 0.0;          // rad, to face the target
};

constexpr double kFacingSpeed = 0.3;  // rad/s, at most, in a straight step

// From G to the point at pre-grasp distance in front of the target.
Step to_pregrasp(const physics_pool::TaskGeometry& geometry, const State& x) {
  const int q = geometry.layout.objects[static_cast<std::size_t>(geometry.layout.target)].q;
  const double dx = x.q[q] - x.q[kJointX], dy = x.q[q + 1] - x.q[kJointY];
  const double distance = std::hypot(dx, dy);
  const double share = distance > 0 ? (distance - hand::kGraspDepth) / distance : 0.0;
  const double turn = std::remainder(std::atan2(dy, dx) - x.q[kJointRotation], 2 * std::numbers::pi);
  return {.dx = share * dx, .dy = share * dy, .turn = turn};
}

// One controller run: Alg. 2 and 3 share everything but when they plan.
class Run {
 public:
  Run(const ControlSetup& setup, const ControlOptions& options, const OnEvent& on_event,
      std::stop_token stop)
      : setup_(setup),
        options_(options),
        on_event_(on_event),
        stop_(std::move(stop)),
        start_(steady_clock::now()),
        deadline_(start_ + options.timeout),
        replan_iterations_(options.few_iterations) {}

  Result<Outcome> go() {
    auto ok = options_.method == ControlOptions::Method::kOnline ? online() : naive();
    outcome_.total_time = steady_clock::now() - start_;
    if (!ok) {
      // Running out of time is how a task fails, not how the system does.
      if (ok.error().code != Code::kDeadline) return ok.error();
      outcome_.reason = fmt::format("timeout after {:.0f} s", outcome_.total_time.count());
    }
    notify(Phase::kDone);
    return std::move(outcome_);
  }

 private:
  // Alg. 2.
  Result<void> online() {
    if (auto ok = observe(); !ok) return ok;
    if (auto ok = plan(straight(), options_.many_iterations); !ok) return ok;
    for (;;) {
      if (auto over_result = over(); !over_result) return over_result.error();
      else if (*over_result) return conclude();
      if (needs_replan()) {
        if (auto ok = replan(); !ok) return ok;
      } else {
        replans_in_a_row_ = 0;
      }
      if (auto ok = act(); !ok) return ok;
    }
  }

  // Lines 8 to 10.
  bool needs_replan() const {
    if (outcome_.actions == acted_at_plan_) return plan_.controls.steps() == 0;  // fresh
    const bool deviated = state_deviation(layout(), plan_.states.front(), x_) > options_.deviation_threshold;
    const bool few_left = plan_.controls.steps() < std::max(options_.min_steps, 1);
    return !plan_.at_goal || deviated || few_left;
  }

  // Lines 11 and 12. Where the last plan fell short of the target the horizon
  // is filled up again, so that there is time to go round, and the iterations
  // grow.
  Result<void> replan() {
    const int wanted = plan_.at_goal ? plan_.controls.steps() + 1
                                     : std::max(plan_.controls.steps() + 1, options_.initial_steps);
    ControlSequence controls = plan_.controls;
    while (controls.steps() < wanted) controls.append(straight_step(plan_.states.back()));
    ++outcome_.replans;
    ++replans_in_a_row_;
    const bool lost = plan_.cost >= setup_.objective.drop && setup_.objective.drop > 0;
    if (auto ok = plan(lost || must_clear_hand() ? back_off() : controls, replan_iterations_); !ok) return ok;
    replan_iterations_ = plan_.at_goal ? options_.few_iterations
                                       : std::min(2 * replan_iterations_, options_.few_iterations_max);
    return {};
  }

  // Alg. 3.
  Result<void> naive() {
    if (auto ok = observe(); !ok) return ok;
    for (;;) {
      if (auto over_result = over(); !over_result) return over_result.error();
      else if (*over_result) return conclude();
      if (plan_made_) ++outcome_.replans;
      if (auto ok = plan(straight(), options_.many_iterations); !ok) return ok;
      while (!options_.plan_only && plan_.controls.steps() > 0) {
        if (auto ok = act(); !ok) return ok;
      }
    }
  }

  Result<void> plan(const ControlSequence& initial, int iterations) {
    notify(Phase::kPlanning);
    const auto before = steady_clock::now();
    Problem problem{.world = setup_.world,
                    .x0 = setup_.make_feasible ? setup_.make_feasible(x_) : x_,
                    .initial = initial,
                    .iterations = iterations,
                    .seed = setup_.seed,
                    .stream = stream_,
                    .clear_hand = must_clear_hand()};
    auto plan_result = setup_.planner.plan(problem, deadline_, stop_);
    if (!plan_result) return plan_result.error();
    plan_ = std::move(plan_result).value();
    acted_at_plan_ = outcome_.actions;
    stream_ += static_cast<std::uint32_t>(iterations);
    outcome_.rollouts += plan_.rollouts;
    outcome_.iterations += plan_.iterations;
    if (!plan_made_) {
      plan_made_ = true;
      outcome_.first_plan = plan_;
      outcome_.plan_time = steady_clock::now() - before;
    }
    return {};
  }

  // Executes u_0, removes it and x_0 from the plan, observes.
  Result<void> act() {
    notify(Phase::kActing);
    if (steady_clock::now() >= deadline_) return Error{Code::kDeadline, "task: out of time"};
    if (auto ok = setup_.robot.execute(plan_.controls.step(0), options_.step_duration, stop_); !ok) {
      return ok;
    }
    ++outcome_.actions;
    plan_.controls.drop_first();
    plan_.states.erase(plan_.states.begin());
    return observe();
  }

  Result<void> observe() {
    auto robot_result = setup_.robot.read();
    if (!robot_result) return robot_result.error();
    auto objects_result = setup_.objects.read();
    if (!objects_result) return objects_result.error();
    auto state_result = assemble_state(layout(), *robot_result, *objects_result);
    if (!state_result) return state_result.error();
    x_ = std::move(state_result).value();
    outcome_.observed.push_back(x_);
    in_hand_ = robot_result->object_in_hand.value_or(
        physics_pool::at_goal(setup_.geometry, x_, setup_.objective));
    outcome_.dropped.clear();
    for (const int i : physics_pool::dropped_objects(setup_.geometry, x_, setup_.objective.drop_height)) {
      outcome_.dropped.push_back(layout().objects[static_cast<std::size_t>(i)].name);
    }
    return {};
  }

  // Whether the task has ended; closes the hand on the target to be sure, and
  // opens it again if the target slipped out.
  Result<bool> over() {
    if (!outcome_.dropped.empty() || (options_.plan_only && plan_made_)) return true;
    if (!in_hand_) return false;
    if (!options_.close_hand) return true;
    if (auto ok = move_fingers(-hand::kStroke); !ok) return ok.error();
    if (in_hand_ || !outcome_.dropped.empty()) return true;
    if (auto ok = move_fingers(hand::kStroke); !ok) return ok.error();
    plan_.controls = {};
    plan_.states = {x_};
    plan_.at_goal = false;
    return !outcome_.dropped.empty();
  }

  Result<void> conclude() {
    if (!outcome_.dropped.empty()) {
      outcome_.reason = fmt::format("dropped {}", fmt::join(outcome_.dropped, ", "));
    } else if (in_hand_) {
      outcome_.success = true;
      outcome_.reason = "target grasped";
    } else {
      outcome_.success = plan_.at_goal;
      outcome_.reason = plan_.at_goal ? "plan reaches the target; not executed"
                                      : "plan does not reach the target; not executed";
    }
    return {};
  }

  // Opens or closes by `way` metres, or until the fingers meet something.
  Result<void> move_fingers(double way) {
    notify(Phase::kClosing);
    std::vector<double> u(kGripperAxes, 0.0);
    u[kControlOpening] = way / options_.step_duration;
    if (auto ok = setup_.robot.execute(u, options_.step_duration, stop_); !ok) return ok;
    return observe();
  }

  ControlSequence straight() const {
    return straight_line(setup_.geometry, x_, options_.initial_steps, options_.step_duration);
  }

  bool must_clear_hand() const {
    return replans_in_a_row_ > options_.obstruction_patience &&
           physics_pool::count_obstructions(setup_.geometry, x_) > 0;
  }

  // A way out where going on cannot end well: backwards by a finger's length, so
  // that what lodges between the fingers stays behind, then straight again.
  ControlSequence back_off() const {
    const int back = std::max(options_.initial_steps / 3, 1);
    const double speed = hand::kFingerLength / (back * options_.step_duration);
    State away = x_;
    ControlSequence controls;
    std::vector<double> u(kGripperAxes, 0.0);
    u[kControlX] = -speed * std::cos(x_.q[kJointRotation]);
    u[kControlY] = -speed * std::sin(x_.q[kJointRotation]);
    for (int t = 0; t < back; ++t) controls.append(u);
    away.q[kJointX] += u[kControlX] * back * options_.step_duration;
    away.q[kJointY] += u[kControlY] * back * options_.step_duration;
    const int forth = std::max(options_.initial_steps - back, 1);
    controls.append(straight_line(setup_.geometry, away, forth, options_.step_duration).values);
    return controls;
  }

  // "Single straight step to target" (Alg. 2, line 11): towards it, turning to
  // face it, hand opening.
  std::vector<double> straight_step(const State& x) const {
    const Step way = to_pregrasp(setup_.geometry, x);
    const double distance = std::hypot(way.dx, way.dy);
    const double speed = std::min(options_.straight_speed, distance / options_.step_duration);
    std::vector<double> u(kGripperAxes, 0.0);
    if (distance > 0) {
      u[kControlX] = speed * way.dx / distance;
      u[kControlY] = speed * way.dy / distance;
    }
    u[kControlRotation] = std::clamp(way.turn / options_.step_duration, -kFacingSpeed, kFacingSpeed);
    u[kControlOpening] = (hand::kStroke - x.q[kJointLeft] - x.q[kJointRight]) / options_.step_duration;
    return u;
  }

  void notify(Phase phase) const {
    if (!on_event_) return;
    on_event_({.phase = phase,
               .actions = outcome_.actions,
               .replans = outcome_.replans,
               .plan = plan_made_ ? &plan_ : nullptr,
               .observed = &x_});
  }

  const StateLayout& layout() const { return setup_.geometry.layout; }

  const ControlSetup& setup_;
  const ControlOptions& options_;
  const OnEvent& on_event_;
  std::stop_token stop_;
  steady_clock::time_point start_, deadline_;
  State x_;
  bool in_hand_ = false;
  Plan plan_;
  bool plan_made_ = false;
  std::uint32_t stream_ = 0;
  int replan_iterations_;  // FewIter, grown
  int replans_in_a_row_ = 0;
  int acted_at_plan_ = -1;  // actions executed when the present plan was made
  Outcome outcome_;
};

}  // namespace

Result<Outcome> run_controller(const ControlSetup& setup, const ControlOptions& options,
                               const OnEvent& on_event, std::stop_token stop) {
  return Run(setup, options, on_event, std::move(stop)).go();
}

ControlSequence straight_line(const physics_pool::TaskGeometry& geometry, const State& x, int steps,
                              double step_duration) {
  const Step way = to_pregrasp(geometry, x);
  const double duration = steps * step_duration;
  ControlSequence controls;
  for (int t = 0; t < steps; ++t) {
    controls.append(std::array{way.dx / duration, way.dy / duration, 0.0, 0.0});
  }
  return controls;
}

double state_deviation(const StateLayout& layout, const State& a, const State& b) {
  double sum = 0.0;
  const auto add = [&](std::size_t i) { sum += (a.q[i] - b.q[i]) * (a.q[i] - b.q[i]); };
  for (std::size_t i = 0; i < layout.joints.size(); ++i) add(i);
  for (const ObjectSlot& object : layout.objects) {
    const auto q = static_cast<std::size_t>(object.q);
    for (std::size_t i = q; i < q + 3; ++i) add(i);
    double dot = 0.0;
    for (std::size_t i = q + 3; i < q + 7; ++i) dot += a.q[i] * b.q[i];
    const double angle = 2 * std::acos(std::min(std::abs(dot), 1.0));
    sum += angle * angle;
  }
  return std::sqrt(sum);
}

Result<State> assemble_state(const StateLayout& layout, const robot_bridge::RobotReading& robot,
                             const std::vector<perception::ObjectReading>& objects) {
  if (robot.q.size() != layout.joints.size() || robot.v.size() != layout.joints.size()) {
    return Error{Code::kInvalidArgument,
                 fmt::format("robot: got {} positions and {} velocities, wanted {} joints",
                             robot.q.size(), robot.v.size(), layout.joints.size())};
  }
  State x;
  x.q = robot.q;
  x.v = robot.v;
  for (const ObjectSlot& slot : layout.objects) {
    const auto found = std::ranges::find(objects, slot.name, &perception::ObjectReading::name);
    if (found == objects.end()) {
      return Error{Code::kInvalidArgument,
                   fmt::format("objects: no measurement of '{}', wanted all {} objects of the scene",
                               slot.name, layout.objects.size())};
    }
    x.q.insert(x.q.end(), found->position.begin(), found->position.end());
    x.q.insert(x.q.end(), found->orientation.begin(), found->orientation.end());
    x.v.insert(x.v.end(), found->linear.begin(), found->linear.end());
    x.v.insert(x.v.end(), found->angular.begin(), found->angular.end());
  }
  return x;
}

}  // namespace jostle::planners
