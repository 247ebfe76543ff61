#include "planners/mpc/mpc.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

namespace jostle::planners {
namespace {

constexpr double kLost = 0.001;      // m; a plan that moves the target less does not push it
constexpr double kClearance = 0.01;  // m between target and a pusher that goes round it
constexpr double kBehind = 0.8;      // rad; further off the line of a push the pusher slips off

struct Point {
  double x = 0.0, y = 0.0;  // m
};

Point target_in(const physics_pool::TaskGeometry& geometry, const State& x) {
  const double* p = geometry.view(x).target().position();
  return {p[0], p[1]};
}

class Run {
 public:
  Run(const ControlSetup& setup, const MpcOptions& options, const OnEvent& on_event, std::stop_token stop)
      : setup_(setup),
        options_(options),
        execution_(setup, options.step_duration, on_event, std::move(stop)),
        objective_(setup.objective) {
    objective_["obstruction"].weight = 0.0;  // a push grasps nothing
  }

  Result<Outcome> go() { return execution_.end(push()); }

 private:
  Result<void> push() {
    if (auto ok = execution_.observe(); !ok) return ok;
    PlanRequest request{.initial = straight(execution_.x(), options_.horizon),
                        .iterations = options_.first_iterations,
                        .objective = objective_};
    while (!execution_.is_over(options_.max_actions)) {
      if (execution_.has_planned()) ++execution_.outcome().replans;
      if (auto ok = execution_.plan(request); !ok) return ok;
      if (options_.plan_only) return conclude_plan();
      const auto u = execution_.plan().controls.step(0);
      u_before_.assign(u.begin(), u.end());
      if (auto ok = execution_.act(0.0, std::bind_front(&Run::next, this)); !ok) return ok;
      request = warm_start(execution_.x(), execution_.plan());
    }
    return {};
  }

  std::optional<PlanRequest> next(const State& x, const Plan& left) const {
    if (execution_.will_be_over(x, options_.max_actions)) return {};
    return warm_start(x, left);
  }

  // What is left of the plan, filled up to the horizon. A plan that has lost the target
  // does not find it again by small changes: then a straight push, from where it is.
  PlanRequest warm_start(const State& x, const Plan& left) const {
    PlanRequest request{
        .initial = left.controls, .iterations = options_.iterations, .objective = objective_, .u_before = u_before_};
    if (way_of_target(left.states) < kLost) {
      request.initial = straight(x, options_.horizon);
    } else if (const int missing = options_.horizon - left.controls.steps(); missing > 0) {
      request.initial.append(straight(left.states.back(), missing).values);
    }
    return request;
  }

  // From first to last, m.
  double way_of_target(const Trajectory& states) const {
    const Point from = target_in(setup_.geometry, states.front()), to = target_in(setup_.geometry, states.back());
    return std::hypot(to.x - from.x, to.y - from.y);
  }

  ControlSequence straight(const State& from, int steps) const {
    return straight_push(setup_.geometry, from, steps, options_.step_duration, options_.straight_speed);
  }

  Result<void> conclude_plan() {
    if (execution_.plan().at_goal) {
      execution_.outcome().conclude(Ending::kSucceeded, "plan reaches the goal region; not executed");
    } else {
      execution_.outcome().conclude(Ending::kFailed, "plan does not reach the goal region; not executed");
    }
    return {};
  }

  const ControlSetup& setup_;
  const MpcOptions& options_;
  Execution execution_;
  physics_pool::Objective objective_;  // of its plans
  std::vector<double> u_before_;       // [nu] the newest executed control; empty before the first
};

}  // namespace

Result<Outcome> run_mpc(const ControlSetup& setup, const MpcOptions& options, const OnEvent& on_event,
                        std::stop_token stop) {
  return Run(setup, options, on_event, std::move(stop)).go();
}

ControlSequence straight_push(const physics_pool::TaskGeometry& geometry, const State& x, int steps,
                              double step_duration, double speed) {
  const physics_pool::SceneObject& shape = geometry.target;
  const double radius =
      shape.shape == physics_pool::Shape::kBox ? std::hypot(shape.size[0], shape.size[1]) / 2 : shape.radius;
  const double reach = radius + geometry.disc_radius + kClearance;
  const double stride = speed * step_duration;
  Point target = target_in(geometry, x), pusher;
  const Eigen::Isometry3d X_WT = physics_pool::tool_pose(geometry, x);
  pusher = {X_WT.translation().x(), X_WT.translation().y()};
  ControlSequence controls{.nu = geometry.layout.nu};
  std::vector<double> u(static_cast<std::size_t>(controls.nu), 0.0);
  for (int t = 0; t < steps; ++t) {
    const double dx = geometry.task.goal.x - target.x, dy = geometry.task.goal.y - target.y;
    const double way = std::hypot(dx, dy), push = std::atan2(dy, dx);
    // Where the pusher is as seen from the target: 0 straight behind it.
    const double around =
        std::remainder(std::atan2(target.y - pusher.y, target.x - pusher.x) - push, 2 * std::numbers::pi);
    Point step;
    if (std::abs(around) <= kBehind) {
      const double length = std::min(stride, way / (steps - t));
      step = {length * std::cos(push), length * std::sin(push)};
      target = {target.x + step.x, target.y + step.y};
    } else {
      const double angle = push + around - std::copysign(std::min(std::abs(around), stride / reach), around);
      const Point to{target.x - reach * std::cos(angle), target.y - reach * std::sin(angle)};
      const double far = std::hypot(to.x - pusher.x, to.y - pusher.y);
      const double share = far > stride ? stride / far : 1.0;
      step = {share * (to.x - pusher.x), share * (to.y - pusher.y)};
    }
    pusher = {pusher.x + step.x, pusher.y + step.y};
    u[static_cast<std::size_t>(geometry.planar->x)] = step.x / step_duration;
    u[static_cast<std::size_t>(geometry.planar->y)] = step.y / step_duration;
    controls.append(u);
  }
  return controls;
}

}  // namespace jostle::planners
