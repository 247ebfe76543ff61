#include "planners/adaptive/adaptive.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "physics_pool/objective/scorer.hpp"

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
    for (ControlSequence left; !is_over(); left = execution_.plan().controls) {
      if (execution_.has_planned()) ++execution_.outcome().replans;
      if (auto ok = execution_.plan(left, options_.iterations, objective_); !ok) return ok;
      if (options_.plan_only) return conclude_plan();
      if (auto ok = execution_.act(); !ok) return ok;
      if (auto ok = execution_.rest(options_.rest); !ok) return ok;
    }
    return {};
  }

  bool is_over() {
    Outcome& outcome = execution_.outcome();
    const physics_pool::TaskGeometry& geometry = setup_.geometry;
    if (!outcome.dropped.empty()) {
      outcome.conclude(Ending::kFailed, fmt::format("dropped {}", fmt::join(outcome.dropped, ", ")));
    } else if (const std::string failure = geometry.kind->failure(geometry, execution_.x()); !failure.empty()) {
      outcome.conclude(Ending::kFailed, failure);
    } else if (physics_pool::at_goal(geometry, execution_.x(), setup_.objective)) {
      outcome.conclude(Ending::kSucceeded, geometry.kind->achieved);
    } else if (outcome.actions >= options_.max_actions) {
      outcome.conclude(Ending::kFailed, fmt::format("not there after {} actions", outcome.actions));
    }
    return outcome.is_over();
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
