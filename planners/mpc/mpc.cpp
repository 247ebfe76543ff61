#include "planners/mpc/mpc.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace jostle::planners {
namespace {

class Run {
 public:
  Run(const ControlSetup& setup, const MpcOptions& options, const OnEvent& on_event, std::stop_token stop)
      : setup_(setup),
        options_(options),
        execution_(setup, options.step_duration, options.timeout, on_event, std::move(stop)) {}

  Result<Outcome> go() { return execution_.end(push()); }

 private:
  Result<void> push() {
    if (auto ok = execution_.observe(); !ok) return ok;
    for (ControlSequence initial = straight(x(), options_.horizon); !is_over();) {
      const bool first = !execution_.has_planned();
      if (!first) ++execution_.outcome().replans;
      const int iterations = first ? options_.first_iterations : options_.iterations;
      if (auto ok = execution_.plan(initial, iterations, false, u_before_); !ok) return ok;
      if (options_.plan_only) return conclude_plan();
      const auto u = execution_.plan().controls.step(0);
      u_before_.assign(u.begin(), u.end());
      if (auto ok = execution_.act(); !ok) return ok;
      initial = shifted();
    }
    return {};
  }

  // What is left of the plan, filled up to the horizon.
  ControlSequence shifted() const {
    ControlSequence controls = execution_.plan().controls;
    if (const int missing = options_.horizon - controls.steps(); missing > 0) {
      controls.append(straight(execution_.plan().states.back(), missing).values);
    }
    return controls;
  }

  ControlSequence straight(const State& from, int steps) const {
    return straight_push(setup_.geometry, from, steps, options_.step_duration, options_.straight_speed);
  }

  bool is_over() {
    Outcome& outcome = execution_.outcome();
    const physics_pool::TaskGeometry& geometry = setup_.geometry;
    if (!outcome.dropped.empty()) {
      outcome.reason = fmt::format("dropped {}", fmt::join(outcome.dropped, ", "));
    } else if (physics_pool::target_hits_obstacle(geometry, x())) {
      outcome.reason = "target hit the obstacle";
    } else if (physics_pool::pusher_hits_obstacle(geometry, x())) {
      outcome.reason = "pusher hit the obstacle";
    } else if (const auto inside = physics_pool::intruders(geometry, x()); !inside.empty()) {
      outcome.reason = fmt::format("{} in the goal region", names_of(execution_.layout(), inside));
    } else if (physics_pool::at_goal(geometry, x(), setup_.objective)) {
      outcome.success = true;
      outcome.reason = "target in the goal region";
    } else if (outcome.actions >= options_.max_actions) {
      outcome.reason = fmt::format("not in the goal region after {} actions", outcome.actions);
    }
    return !outcome.reason.empty();
  }

  Result<void> conclude_plan() {
    Outcome& outcome = execution_.outcome();
    outcome.success = execution_.plan().at_goal;
    outcome.reason = outcome.success ? "plan reaches the goal region; not executed"
                                     : "plan does not reach the goal region; not executed";
    return {};
  }

  const State& x() const { return execution_.x(); }

  const ControlSetup& setup_;
  const MpcOptions& options_;
  Execution execution_;
  std::vector<double> u_before_;  // [nu] the newest executed control; empty before the first
};

}  // namespace

Result<Outcome> run_mpc(const ControlSetup& setup, const MpcOptions& options, const OnEvent& on_event,
                        std::stop_token stop) {
  return Run(setup, options, on_event, std::move(stop)).go();
}

ControlSequence straight_push(const physics_pool::TaskGeometry& geometry, const State& x, int steps,
                              double step_duration, double speed) {
  const auto target = static_cast<std::size_t>(geometry.layout.target);
  const auto q = static_cast<std::size_t>(geometry.layout.objects[target].q);
  const double dx = geometry.task.goal.x - x.q[q], dy = geometry.task.goal.y - x.q[q + 1];
  const double distance = std::hypot(dx, dy);
  const double pace = distance > 0 ? std::min(speed, distance / (steps * step_duration)) / distance : 0.0;
  ControlSequence controls{.nu = kPusherAxes};
  for (int t = 0; t < steps; ++t) controls.append(std::array{pace * dx, pace * dy});
  return controls;
}

PbstoOptions push_planner_options() {
  PbstoOptions options;
  options.rollouts = 20;
  options.sigma = {0.01, 0.01};
  options.limit = {0.1, 0.1};
  options.scales = {1.0, 2.0, 4.0, 0.5};
  options.min_steps = 0;
  options.objective.success_cost = 10000.0;
  return options;
}

}  // namespace jostle::planners
