#include "planners/robustness/robust_control.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "physics_pool/objective/scorer.hpp"
#include "physics_pool/task/state_distance.hpp"
#include "planners/control/controller.hpp"

namespace jostle::planners {
namespace {

using Method = RobustControlOptions::Method;

class Run {
 public:
  Run(const ControlSetup& setup, const RobustControlOptions& options, const OnEvent& on_event, std::stop_token stop)
      : setup_(setup),
        options_(options),
        execution_(setup, options.step_duration, on_event, std::move(stop)),
        to_goal_(setup.objective),
        to_state_(setup.objective) {
    to_goal_["state"].values.clear();
    to_state_["goal"].weight = to_state_["pads"].weight = 0.0;
  }

  Result<Outcome> go() { return execution_.end(reach()); }

 private:
  Result<void> reach() {
    if (auto ok = execution_.observe(); !ok) return ok;
    const ControlSequence initial = straight(x(), options_.horizon);
    if (options_.method == Method::kClosedLoop) {
      if (auto ok = closed_loop_to_goal(initial); !ok) return ok;
      return conclude();
    }
    if (auto ok = execution_.plan({.initial = initial, .iterations = options_.iterations, .objective = to_goal_}); !ok)
      return ok;
    if (options_.plan_only) return conclude();
    const Plan plan = execution_.plan();
    const Segment whole{.from = 0, .to = plan.controls.steps(), .is_robust = false, .metric = 0.0};
    auto ok = options_.method == Method::kOpenLoop ? open_loop(plan, whole) : interleaved(plan, whole);
    return ok ? conclude() : ok;
  }

  // Lines 3 to 8 of Alg. 4. `plan`: X*, U* and what is robust of them; nothing is where nobody looked.
  Result<void> interleaved(const Plan& plan, const Segment& whole) {
    Outcome& outcome = execution_.outcome();
    outcome.segments = plan.robustness ? plan.robustness->segments : std::vector<Segment>{whole};
    for (std::size_t s = 0; s < outcome.segments.size() && !has_failed(); ++s) {
      outcome.segment = static_cast<int>(s);
      const Segment segment = outcome.segments[s];
      const bool begins_there = is_near(plan.states[static_cast<std::size_t>(segment.from)]);
      if (segment.is_robust && !begins_there) ++outcome.mismatches;
      const bool is_last = s + 1 == outcome.segments.size();
      auto ok = segment.is_robust && begins_there
                    ? open_loop(plan, segment)
                    : (is_last ? closed_loop_to_goal(part(plan.controls, segment)) : closed_loop(plan, segment));
      if (!ok) return ok;
    }
    outcome.segment = -1;
    return {};
  }

  // Nothing that is observed on the way changes anything.
  Result<void> open_loop(const Plan& plan, const Segment& segment) {
    execution_.plan().controls = part(plan.controls, segment);
    execution_.plan().states = {plan.states.begin() + segment.from, plan.states.begin() + segment.to + 1};
    while (execution_.plan().controls.steps() > 0) {
      ++execution_.outcome().open_loop_actions;
      if (auto ok = act(); !ok) return ok;
    }
    return {};
  }

  Result<void> closed_loop(const Plan& plan, const Segment& segment) {
    const State& end = plan.states[static_cast<std::size_t>(segment.to)];
    to_state_["state"].values = end.q;
    ControlSequence controls = part(plan.controls, segment);
    const int most = 2 * controls.steps();
    for (int t = 0; t < most && !is_near(end) && !has_failed(); ++t) {
      if (controls.steps() == 0) controls = towards(end);
      if (auto ok = plan_and_act(controls, to_state_); !ok) return ok;
      controls = execution_.plan().controls;
    }
    return {};
  }

  Result<void> closed_loop_to_goal(ControlSequence controls) {
    for (int t = 0; t < options_.max_actions && !is_in_hand() && !has_failed(); ++t) {
      if (options_.plan_only && execution_.has_planned()) break;
      if (auto ok = plan_and_act(controls, to_goal_); !ok) return ok;
      controls = execution_.plan().controls;
      const State end = execution_.plan().states.back();
      while (controls.steps() < options_.horizon) controls.append(straight(end, 1).values);
    }
    return {};
  }

  Result<void> plan_and_act(const ControlSequence& controls, const physics_pool::Objective& objective) {
    const bool is_first = !execution_.has_planned();
    if (!is_first) ++execution_.outcome().replans;
    const int iterations = is_first ? options_.iterations : options_.mpc_iterations;
    if (auto ok = execution_.plan({.initial = controls,
                                   .iterations = iterations,
                                   .objective = objective,
                                   .u_before = u_before_,
                                   .weigh_robustness = false});
        !ok)
      return ok;
    return options_.plan_only ? Result<void>{} : act();
  }

  Result<void> act() {
    const auto u = execution_.plan().controls.step(0);
    u_before_.assign(u.begin(), u.end());
    return execution_.act();
  }

  // One action that brings the robot's joints to those of a state, if nothing is in the way.
  ControlSequence towards(const State& end) const {
    ControlSequence controls{.nu = execution_.layout().nu};
    for (const physics_pool::Axis& axis : setup_.geometry.robot.axes) {
      const auto& [joint, factor] = axis.joints.front();
      const auto j = static_cast<std::size_t>(joint);
      controls.values.push_back((end.q[j] - x().q[j]) / (factor * options_.step_duration));
    }
    return controls;
  }

  ControlSequence straight(const State& from, int steps) const {
    return straight_line(setup_.geometry, from, steps, options_.step_duration);
  }

  static ControlSequence part(const ControlSequence& whole, const Segment& segment) {
    ControlSequence controls{.nu = whole.nu};
    for (int t = segment.from; t < segment.to; ++t) controls.append(whole.step(t));
    return controls;
  }

  bool is_near(const State& there) const {
    return physics_pool::state_distance(setup_.geometry, x().q, there.q) <= options_.interface_distance;
  }

  bool is_in_hand() const {
    return execution_.robot().object_in_hand.value_or(physics_pool::at_goal(setup_.geometry, x(), setup_.objective));
  }

  bool has_failed() const { return !execution_.outcome().dropped.empty(); }

  Result<void> conclude() {
    Outcome& outcome = execution_.outcome();
    const int others = physics_pool::count_obstructions(setup_.geometry, x());
    if (options_.plan_only && execution_.has_planned()) {
      const bool there = execution_.plan().at_goal;
      outcome.conclude(there ? Ending::kSucceeded : Ending::kFailed,
                       fmt::format("plan {} the target; not executed", there ? "reaches" : "does not reach"));
    } else if (has_failed()) {
      outcome.conclude(Ending::kFailed, fmt::format("dropped {}", fmt::join(outcome.dropped, ", ")));
    } else if (others > 0) {  // rows 1 and 2 of Fig. 4.7
      outcome.conclude(Ending::kFailed, fmt::format("{} other object{} in the hand", others, others > 1 ? "s" : ""));
    } else if (is_in_hand()) {
      outcome.conclude(Ending::kSucceeded, "target reached");
    } else {
      outcome.conclude(Ending::kFailed, fmt::format("target not reached after {} actions", outcome.actions));
    }
    return {};
  }

  const State& x() const { return execution_.x(); }

  const ControlSetup& setup_;
  const RobustControlOptions& options_;
  Execution execution_;
  physics_pool::Objective to_goal_, to_state_;  // of plans with the task's final cost, and with x^d
  std::vector<double> u_before_;                // [nu] the newest executed control; empty before the first
};

RobustControlOptions with(RobustControlOptions options, Method method) {
  options.method = method;
  return options;
}

}  // namespace

RobustControlOptions open_loop(RobustControlOptions options) {
  options.planner.starts = 0;
  return with(options, Method::kOpenLoop);
}

RobustControlOptions robust_open_loop(RobustControlOptions options) { return with(options, Method::kOpenLoop); }

RobustControlOptions convergent(RobustControlOptions options) {
  options.planner.worlds = 0;
  return with(options, Method::kOpenLoop);
}

RobustControlOptions closed_loop(RobustControlOptions options) {
  options.planner.starts = 0;
  return with(options, Method::kClosedLoop);
}

RobustControlOptions interleaved(RobustControlOptions options) { return with(options, Method::kInterleaved); }

Result<Outcome> run_robust(const ControlSetup& setup, const RobustControlOptions& options, const OnEvent& on_event,
                           std::stop_token stop) {
  return Run(setup, options, on_event, std::move(stop)).go();
}

}  // namespace jostle::planners
