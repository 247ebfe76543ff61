// A controller that a program brings along: this file is all there is to it.

#include "planners/controllers/catalogue.hpp"

namespace jostle::planners {
namespace {

Result<void> take_two_steps(Execution& execution) {
  if (auto ok = execution.observe(); !ok) return ok;
  ControlSequence still{.nu = execution.layout().nu};
  still.values.assign(2 * static_cast<std::size_t>(still.nu), 0.0);
  if (auto ok = execution.plan({.initial = still, .iterations = 1, .objective = execution.objective()}); !ok) return ok;
  for (int step = 0; step < 2; ++step) {
    if (auto ok = execution.act(); !ok) return ok;
  }
  execution.outcome().conclude(Ending::kSucceeded, "two steps taken");
  return {};
}

const ControllerKind kTwoSteps{
    .name = "two-steps",
    .purpose = "plans once and acts twice",
    .parameters = "experiments/grasping.yaml",
    .fits = [](const physics_pool::Scene&) { return true; },
    .run =
        [](const ControlSetup& setup, const ControllerOptions& options, const OnEvent& on_event, std::stop_token stop) {
          Execution execution(setup, options.control.step_duration, on_event, std::move(stop));
          return execution.end(take_two_steps(execution));
        }};

[[maybe_unused]] const bool kAdded = (add_controller(kTwoSteps), true);

}  // namespace
}  // namespace jostle::planners
