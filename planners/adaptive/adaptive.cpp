#include "planners/adaptive/adaptive.hpp"

#include <fmt/format.h>

#include <functional>

namespace jostle::planners {
namespace {

class Run {
 public:
  Run(const ControlSetup& setup, const AdaptiveOptions& options, const OnEvent& on_event, std::stop_token stop)
      : setup_(setup),
        options_(options),
        execution_(setup, options.step_duration, on_event, std::move(stop)),
        objective_(setup.objective) {
    objective_["obstruction"].weight = 0.0;  // neither L nor L_f of Chapter 5 knows it
  }

  Result<Outcome> go() { return execution_.end(adapt()); }

 private:
  Result<void> adapt() {
    if (auto ok = execution_.observe(); !ok) return ok;
    for (ControlSequence left; !execution_.is_over(options_.max_actions); left = execution_.plan().controls) {
      if (execution_.has_planned()) ++execution_.outcome().replans;
      if (auto ok = execution_.plan(request(left)); !ok) return ok;
      if (options_.plan_only) return conclude_plan();
      if (auto ok = execution_.act(options_.rest, std::bind_front(&Run::next, this)); !ok) return ok;
    }
    return {};
  }

  PlanRequest request(const ControlSequence& left) const {
    return {.initial = left, .iterations = options_.iterations, .objective = objective_};
  }

  std::optional<PlanRequest> next(const State& x, const Plan& left) const {
    if (execution_.will_be_over(x, options_.max_actions)) return {};
    return request(left.controls);
  }

  Result<void> conclude_plan() {
    const bool there = execution_.plan().at_goal;
    execution_.outcome().conclude(there ? Ending::kSucceeded : Ending::kFailed,
                                  fmt::format("plan {} the goal; not executed", there ? "reaches" : "does not reach"));
    return {};
  }

  const ControlSetup& setup_;
  const AdaptiveOptions& options_;
  Execution execution_;
  physics_pool::Objective objective_;  // of its plans
};

}  // namespace

AdaptiveOptions slow_only(AdaptiveOptions options) {
  options.least_actions = options.most_actions;
  return options;
}

AdaptiveOptions standard_mpc(AdaptiveOptions options) {
  options = slow_only(options);
  options.sequences = 1;
  options.samples = 0;
  return options;
}

Result<Outcome> run_adaptive(const ControlSetup& setup, const AdaptiveOptions& options, const OnEvent& on_event,
                             std::stop_token stop) {
  return Run(setup, options, on_event, std::move(stop)).go();
}

}  // namespace jostle::planners
