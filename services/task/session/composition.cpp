#include "services/task/session/composition.hpp"

#include "physics_pool/local/simulator.hpp"

namespace jostle::task {

Result<Composition> Composition::make(RunParts parts, physics_pool::Pool& pool) {
  Composition run;
  run.pool_ = &pool;
  if (auto ok = check_fit(parts.parameters, parts.belief); !ok) return ok.error();
  auto controller_result = planners::find_controller(parts.controller, parts.belief);
  if (!controller_result) return controller_result.error();
  run.controller_ = *controller_result;
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
  planners::Pbsto optimizer(*pool_, parts_.parameters.planner, watch.on_progress);
  const std::unique_ptr<planners::Planner> around = watch.around_planner ? watch.around_planner(optimizer) : nullptr;
  planners::ControlSetup setup{.planner = around ? *around : optimizer,
                               .robot = robot,
                               .objects = objects,
                               .geometry = geometry(),
                               .objective = parts_.parameters.planner.objective,
                               .world = world_,
                               .seed = parts_.seed};
  if (!parts_.belief_is_exact) {
    setup.make_feasible = [this](const State& x) { return physics_pool::separate(*believed_, x); };
  }
  return controller_->run(setup, parts_.parameters.controller, watch.on_event, std::move(stop));
}

}  // namespace jostle::task
