#include "planners/control/controller.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "physics_pool/objective/scorer.hpp"
#include "planners/approach/straight_reach.hpp"

namespace jostle::planners {
namespace {

struct Step {
  double dx = 0.0, dy = 0.0;  // m, world frame
  double turn = 0.0;          // rad, to face the target
};

constexpr double kFacingSpeed = 0.3;  // rad/s, at most, in a straight step

// Where G is and where it looks to.
struct HandPlace {
  double x = 0.0, y = 0.0, heading = 0.0;  // m, rad
};

HandPlace hand_place(const physics_pool::TaskGeometry& geometry, const State& x) {
  const Eigen::Isometry3d X_WG = physics_pool::tool_pose(geometry, x);
  const std::size_t rotation = 2;  // joint of a planar robot's heading
  return {.x = X_WG.translation().x(), .y = X_WG.translation().y(), .heading = x.q[rotation]};
}

// From G to the point at pre-grasp distance in front of the target.
Step to_pregrasp(const physics_pool::TaskGeometry& geometry, const State& x) {
  const HandPlace hand = hand_place(geometry, x);
  const double* target = geometry.view(x).target().position();
  const double dx = target[0] - hand.x, dy = target[1] - hand.y;
  const double distance = std::hypot(dx, dy);
  const double share = distance > 0 ? (distance - geometry.robot.hand->depth) / distance : 0.0;
  const double turn = std::remainder(std::atan2(dy, dx) - hand.heading, 2 * std::numbers::pi);
  return {.dx = share * dx, .dy = share * dy, .turn = turn};
}

// One controller run: Alg. 2 and 3 share everything but when they plan.
class Run {
 public:
  Run(const ControlSetup& setup, const ControlOptions& options, const OnEvent& on_event, std::stop_token stop)
      : setup_(setup),
        options_(options),
        execution_(setup, options.step_duration, on_event, std::move(stop)),
        replan_iterations_(options.few_iterations) {}

  Result<Outcome> go() {
    return execution_.end(options_.method == ControlOptions::Method::kOnline ? online() : naive());
  }

 private:
  // Alg. 2.
  Result<void> online() {
    if (auto ok = observe(); !ok) return ok;
    if (auto ok = execution_.plan(whole_plan(x())); !ok) return ok;
    for (;;) {
      if (auto over_result = over(); !over_result)
        return over_result.error();
      else if (*over_result)
        return conclude();
      if (needs_replan()) {
        if (auto ok = replan(); !ok) return ok;
      } else {
        replans_in_a_row_ = 0;
      }
      if (auto ok = act(&Run::next_of_online); !ok) return ok;
    }
  }

  bool needs_replan() const {
    const Plan& plan = execution_.plan();
    if (execution_.plan_is_fresh()) return plan.controls.steps() == 0;
    return needs_replan(x(), plan);
  }

  // Lines 8 to 10, after an action that came to x.
  bool needs_replan(const State& x, const Plan& left) const {
    const bool deviated = state_deviation(layout(), left.states.front(), x) > options_.deviation_threshold;
    const bool few_left = left.controls.steps() < std::max(options_.min_steps, 1);
    return !left.at_goal || deviated || few_left;
  }

  Result<void> replan() {
    ++execution_.outcome().replans;
    const PlanRequest request = next_plan(x(), execution_.plan());
    ++replans_in_a_row_;
    if (auto ok = execution_.plan(request); !ok) return ok;
    replan_iterations_ = execution_.plan().at_goal ? options_.few_iterations
                                                   : std::min(2 * replan_iterations_, options_.few_iterations_max);
    return {};
  }

  // Lines 11 and 12, one more re-plan in a row. Where the last plan fell short of the target the horizon
  // is filled up again, so that there is time to go round, and the iterations
  // grow.
  PlanRequest next_plan(const State& x, const Plan& left) const {
    const int wanted =
        left.at_goal ? left.controls.steps() + 1 : std::max(left.controls.steps() + 1, options_.initial_steps);
    ControlSequence controls = left.controls;
    while (controls.steps() < wanted) controls.append(straight_step(left.states.back()));
    const bool must_clear = must_clear_hand(x, replans_in_a_row_ + 1);
    const bool lost = left.cost >= setup_.objective.weight("drop") && setup_.objective.weight("drop") > 0;
    return request(lost || must_clear ? back_off(x) : controls, replan_iterations_, must_clear);
  }

  std::optional<PlanRequest> next_of_online(const State& x, const Plan& left) const {
    if (will_be_over(x) || !needs_replan(x, left)) return {};
    return next_plan(x, left);
  }

  // Alg. 3.
  Result<void> naive() {
    if (auto ok = observe(); !ok) return ok;
    for (;;) {
      if (auto over_result = over(); !over_result)
        return over_result.error();
      else if (*over_result)
        return conclude();
      if (execution_.has_planned()) ++execution_.outcome().replans;
      if (auto ok = execution_.plan(whole_plan(x())); !ok) return ok;
      while (!options_.plan_only && execution_.plan().controls.steps() > 0) {
        if (auto ok = act(&Run::next_of_naive); !ok) return ok;
      }
    }
  }

  std::optional<PlanRequest> next_of_naive(const State& x, const Plan& left) const {
    if (will_be_over(x) || left.controls.steps() > 0) return {};
    return whole_plan(x);
  }

  PlanRequest whole_plan(const State& x) const {
    return request(straight_line(setup_.geometry, x, options_.initial_steps, options_.step_duration),
                   options_.many_iterations, must_clear_hand(x, replans_in_a_row_));
  }

  PlanRequest request(ControlSequence initial, int iterations, bool must_clear) const {
    PlanRequest request{.initial = std::move(initial), .iterations = iterations, .objective = setup_.objective};
    // What has lodged in the hand counts only once predictions have failed that counted on grasping past it.
    if (!must_clear) request.objective["obstruction"].weight = 0.0;
    return request;
  }

  Result<void> act(std::optional<PlanRequest> (Run::*next)(const State&, const Plan&) const) {
    if (auto ok = execution_.act(0.0, std::bind_front(next, this)); !ok) return ok;
    feel();
    return {};
  }

  // As far as can be told without a hand that feels.
  bool will_be_over(const State& x) const {
    return physics_pool::at_goal(setup_.geometry, x, setup_.objective) || !execution_.dropped_in(x).empty();
  }

  Result<void> observe() {
    if (auto ok = execution_.observe(); !ok) return ok;
    feel();
    return {};
  }

  void feel() {
    in_hand_ =
        execution_.robot().object_in_hand.value_or(physics_pool::at_goal(setup_.geometry, x(), setup_.objective));
  }

  // Whether the task has ended; closes the hand on the target to be sure, and
  // opens it again if the target slipped out.
  Result<bool> over() {
    if (!dropped().empty() || (options_.plan_only && execution_.has_planned())) return true;
    if (!in_hand_) return false;
    if (!options_.close_hand) return true;
    if (auto ok = move_fingers(-hand().stroke); !ok) return ok.error();
    if (in_hand_ || !dropped().empty()) return true;
    if (auto ok = move_fingers(hand().stroke); !ok) return ok.error();
    execution_.plan().controls = {};
    execution_.plan().states = {x()};
    execution_.plan().at_goal = false;
    return !dropped().empty();
  }

  Result<void> conclude() {
    Outcome& outcome = execution_.outcome();
    if (!dropped().empty()) {
      outcome.conclude(Ending::kFailed, fmt::format("dropped {}", fmt::join(dropped(), ", ")));
    } else if (in_hand_) {
      outcome.conclude(Ending::kSucceeded, "target grasped");
    } else if (execution_.plan().at_goal) {
      outcome.conclude(Ending::kSucceeded, "plan reaches the target; not executed");
    } else {
      outcome.conclude(Ending::kFailed, "plan does not reach the target; not executed");
    }
    return {};
  }

  // Opens or closes by `way` metres, or until the fingers meet something.
  Result<void> move_fingers(double way) {
    std::vector<double> u = still();
    u[opening()] = way / options_.step_duration;
    if (auto ok = execution_.move(u, Phase::kClosing); !ok) return ok;
    feel();
    return {};
  }

  bool must_clear_hand(const State& x, int replans_in_a_row) const {
    return replans_in_a_row > options_.obstruction_patience && physics_pool::count_obstructions(setup_.geometry, x) > 0;
  }

  // A way out where going on cannot end well: backwards by a finger's length, so
  // that what lodges between the fingers stays behind, then straight again.
  ControlSequence back_off(const State& x) const {
    const int back = std::max(options_.initial_steps / 3, 1);
    const double speed = hand().finger_length / (back * options_.step_duration);
    State away = x;
    ControlSequence controls{.nu = layout().nu};
    std::vector<double> u = still();
    const double heading = hand_place(setup_.geometry, x).heading;
    u[axis_x()] = -speed * std::cos(heading);
    u[axis_y()] = -speed * std::sin(heading);
    for (int t = 0; t < back; ++t) controls.append(u);
    away.q[0] += u[axis_x()] * back * options_.step_duration;  // a planar robot's first joints
    away.q[1] += u[axis_y()] * back * options_.step_duration;
    const int forth = std::max(options_.initial_steps - back, 1);
    controls.append(straight_line(setup_.geometry, away, forth, options_.step_duration).values);
    return controls;
  }

  // "Single straight step to target" (Alg. 2, line 11): towards it, turning to
  // face it, hand opening.
  std::vector<double> straight_step(const State& from) const {
    const Step way = to_pregrasp(setup_.geometry, from);
    const double distance = std::hypot(way.dx, way.dy);
    const double speed = std::min(options_.straight_speed, distance / options_.step_duration);
    std::vector<double> u = still();
    if (distance > 0) {
      u[axis_x()] = speed * way.dx / distance;
      u[axis_y()] = speed * way.dy / distance;
    }
    const auto q = [&](int joint) { return from.q[static_cast<std::size_t>(joint)]; };
    u[static_cast<std::size_t>(setup_.geometry.planar->rotation)] =
        std::clamp(way.turn / options_.step_duration, -kFacingSpeed, kFacingSpeed);
    u[opening()] = (hand().stroke - q(hand().left) - q(hand().right)) / options_.step_duration;
    return u;
  }

  std::vector<double> still() const { return std::vector<double>(static_cast<std::size_t>(layout().nu), 0.0); }
  const physics_pool::Hand& hand() const { return *setup_.geometry.robot.hand; }
  std::size_t axis_x() const { return static_cast<std::size_t>(setup_.geometry.planar->x); }
  std::size_t axis_y() const { return static_cast<std::size_t>(setup_.geometry.planar->y); }
  std::size_t opening() const { return static_cast<std::size_t>(hand().opening); }

  const StateLayout& layout() const { return execution_.layout(); }
  const State& x() const { return execution_.x(); }
  const std::vector<std::string>& dropped() const { return execution_.outcome().dropped; }

  const ControlSetup& setup_;
  const ControlOptions& options_;
  Execution execution_;
  bool in_hand_ = false;
  int replan_iterations_;  // FewIter, grown
  int replans_in_a_row_ = 0;
};

}  // namespace

Result<Outcome> run_controller(const ControlSetup& setup, const ControlOptions& options, const OnEvent& on_event,
                               std::stop_token stop) {
  return Run(setup, options, on_event, std::move(stop)).go();
}

ControlSequence straight_line(const physics_pool::TaskGeometry& geometry, const State& x, int steps,
                              double step_duration) {
  if (!geometry.planar) return straight_reach(geometry, x, steps, step_duration);
  const Step way = to_pregrasp(geometry, x);
  const double duration = steps * step_duration;
  ControlSequence controls{.nu = geometry.layout.nu};
  std::vector<double> u(static_cast<std::size_t>(controls.nu), 0.0);
  u[static_cast<std::size_t>(geometry.planar->x)] = way.dx / duration;
  u[static_cast<std::size_t>(geometry.planar->y)] = way.dy / duration;
  for (int t = 0; t < steps; ++t) controls.append(u);
  return controls;
}

double state_deviation(const StateLayout& layout, const State& a, const State& b) {
  double sum = 0.0;
  const auto add = [&](std::size_t i) { sum += (a.q[i] - b.q[i]) * (a.q[i] - b.q[i]); };
  for (std::size_t i = 0; i < layout.joints.size(); ++i) add(i);
  for (const ObjectSlot& object : layout.objects) {
    const auto q = static_cast<std::size_t>(object.q);
    for (std::size_t i = q; i < q + 3; ++i) add(i);
    const double angle = angle_between(&a.q[q + 3], &b.q[q + 3]);
    sum += angle * angle;
  }
  return std::sqrt(sum);
}

}  // namespace jostle::planners
