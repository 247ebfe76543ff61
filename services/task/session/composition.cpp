#include "services/task/session/composition.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <functional>

#include "physics_pool/local/simulator.hpp"
#include "planners/guided/arm_start.hpp"
#include "planners/guided/guided_start.hpp"

namespace jostle::task {

Result<Composition> Composition::make(RunParts parts, physics_pool::Pool& pool) {
  Composition run;
  run.pool_ = &pool;
  if (auto ok = check_fit(parts.parameters, parts.belief); !ok) return ok.error();
  auto controller_result = planners::find_controller(parts.controller, parts.belief);
  if (!controller_result) return controller_result.error();
  run.controller_ = *controller_result;
  if (const int candidates = parts.parameters.guidance.candidates;
      candidates > 0 && run.controller_->planner && !run.controller_->improves_initial) {
    return invalid("planner.guidance",
                   fmt::format("{} candidates for the controller '{}'", candidates, run.controller_->name),
                   "0 for controllers whose planner makes its own sequences");
  }
  auto world_result = pool.load(parts.belief);
  if (!world_result) return world_result.error();
  run.world_ = *world_result;
  auto believed_result = physics_pool::World::compile(parts.belief);
  if (!believed_result) return believed_result.error();
  run.believed_ = std::move(believed_result).value();
  run.parts_ = std::move(parts);
  run.parts_.parameters.controller.set_plan_only(run.parts_.plan_only);
  return run;
}

Result<planners::Outcome> Composition::perform(robot_bridge::Robot& robot, perception::ObjectSource& objects,
                                               const Watch& watch, std::stop_token stop) {
  const std::unique_ptr<planners::Planner> planner = make_planner(watch.on_progress);
  const std::unique_ptr<planners::Planner> around = watch.around_planner ? watch.around_planner(*planner) : nullptr;
  planners::ControlSetup setup{.planner = around ? *around : *planner,
                               .robot = robot,
                               .objects = objects,
                               .geometry = geometry(),
                               .objective = parts_.parameters.objective,
                               .world = world_,
                               .seed = parts_.seed,
                               .limits = parts_.parameters.limits,
                               .plan_while_acting = parts_.parameters.plan_while_acting,
                               .on_plan = watch.on_plan};
  setup.predict = std::bind_front(&Composition::predict, this);
  if (!parts_.belief_is_exact) {
    setup.make_feasible = [this](const State& x) { return moved_apart(x); };
  }
  return controller_->run(setup, parts_.parameters.controller, watch.on_event, std::move(stop));
}

std::unique_ptr<planners::Planner> Composition::make_planner(const planners::OnProgress& on_progress) const {
  const Parameters& parameters = parts_.parameters;
  if (parameters.guidance.candidates > 0 && !geometry().planar) return make_arm_planner(on_progress);
  std::unique_ptr<planners::GuidedPlanner> guide;
  if (parameters.guidance.candidates > 0) {
    // Iterations are counted by whoever makes the plan.
    auto guide_result = planners::GuidedPlanner::make(*pool_, parts_.belief, parameters.planner, parameters.guidance,
                                                      controller_->planner ? planners::OnProgress{} : on_progress);
    if (guide_result) {
      guide = std::move(guide_result).value();
    } else {
      spdlog::warn("planned without guidance: {}", guide_result.error().message);
    }
  }
  if (guide && !controller_->planner) return guide;
  auto planner = planners::make_planner(*controller_, *pool_, parts_.belief, geometry(), parameters.planner,
                                        parameters.controller, on_progress);
  if (!guide) return planner;
  return std::make_unique<planners::GuidedStart>(std::move(guide), std::move(planner));
}

std::unique_ptr<planners::Planner> Composition::make_arm_planner(const planners::OnProgress& on_progress) const {
  const Parameters& parameters = parts_.parameters;
  const auto own = [&] {
    return planners::make_planner(*controller_, *pool_, parts_.belief, geometry(), parameters.planner,
                                  parameters.controller, on_progress);
  };
  auto guided_result =
      planners::ArmStart::make(*pool_, parts_.belief, geometry(), parameters.planner, parameters.guidance, own());
  if (guided_result) return std::move(guided_result).value();
  spdlog::warn("planned without guidance: {}", guided_result.error().message);
  return own();
}

// As a planner's rollouts of its first step do.
Result<State> Composition::predict(const planners::ActionAhead& action, planners::TimePoint deadline,
                                   std::stop_token stop) const {
  const std::vector<double> none(static_cast<std::size_t>(action.u.nu), 0.0);
  physics_pool::RolloutBatch batch;
  batch.world = world_;
  batch.x0 = action.x;
  batch.nominal = action.u;
  batch.u_before = none;
  batch.step_duration = action.duration;
  batch.rest = action.rest;
  batch.law.sigma = none;
  batch.law.limit = physics_pool::axis_limits(parts_.belief.robot.model);
  batch.law.seed = parts_.seed;
  batch.objective = parts_.parameters.objective;
  batch.stop_losers = false;
  batch.want_all_trajectories = true;
  batch.priority = physics_pool::Priority::kUrgent;
  auto reply_result = pool_->run(batch, deadline, std::move(stop));
  if (!reply_result) return reply_result.error();
  physics_pool::RolloutOutcome& outcome = reply_result->outcomes.front();
  if (outcome.trajectory.size() == 2) return std::move(outcome.trajectory.back());
  return Error{Code::kInvalidArgument, "x: an action from it diverged: " + outcome.reason};
}

Result<State> Composition::moved_apart(const State& x) const {
  constexpr double kDepth = 0.0005;  // m
  auto result = physics_pool::separate(*believed_, x, kDepth);
  if (!result) return result.error();
  if (result->deepest > kDepth) {
    spdlog::warn(
        "what is measured does not fit the believed shapes: {:.1f} mm inside each other, wanted at most {:.1f}; "
        "planned from there all the same",
        1e3 * result->deepest, 1e3 * kDepth);
  }
  return std::move(result->x);
}

}  // namespace jostle::task
