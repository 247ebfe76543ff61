#include "services/task/session/task.hpp"

#include <fmt/format.h>

#include <chrono>

#include "physics_pool/local/handles.hpp"
#include "services/common/results/results.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::task {
Task::Task(std::string goal_id, physics_pool::Scene execution, Predictor predictor, Composition run)
    : goal_id_(std::move(goal_id)),
      execution_(std::move(execution)),
      predictor_(std::move(predictor)),
      run_(std::move(run)) {}

Result<Task> Task::prepare(const jostle_msgs::msg::Goal& goal, physics_pool::AsyncPool& pool,
                           std::function<void(const std::string&)> on_split) {
  auto execution_result = physics_pool::parse_scene(goal.execution_scene(), "goal.execution_scene");
  if (!execution_result) return execution_result.error();
  auto planning_result = physics_pool::parse_scene(goal.planning_scene(), "goal.planning_scene");
  if (!planning_result) return planning_result.error();
  auto parameters_result = parse_parameters(goal.parameters(), "goal.parameters");
  if (!parameters_result) return parameters_result.error();
  auto predictor_result =
      Predictor::make(goal.predictor().empty() ? "fine" : goal.predictor(), pool, std::move(on_split));
  if (!predictor_result) return predictor_result.error();
  const bool is_exact = physics_pool::scene_hash(*planning_result) == physics_pool::scene_hash(*execution_result);
  auto run_result = Composition::make({.belief = std::move(planning_result).value(),
                                       .belief_is_exact = is_exact,
                                       .parameters = std::move(parameters_result).value(),
                                       .controller = goal.controller(),
                                       .seed = goal.seed(),
                                       .plan_only = goal.plan_only()},
                                      predictor_result->pool());
  if (!run_result) return run_result.error();
  return Task(goal.goal_id(), std::move(execution_result).value(), std::move(predictor_result).value(),
              std::move(run_result).value());
}

Result<planners::Outcome> Task::perform(robot_bridge::Robot& robot, perception::ObjectSource& objects,
                                        const Watch& watch, std::stop_token stop) {
  Journal journal(goal_id_, run_.parameters().planner.step_duration, watch.time, watch.journal);
  Journal::Robot journal_robot(journal, robot);
  Journal::Objects journal_objects(journal, objects);
  return run_.perform(journal_robot, journal_objects,
                      {.on_event =
                           [&](const planners::ControlEvent& event) {
                             if (event.phase == planners::Phase::kActing) journal.idled(event.outcome.idle.back());
                             if (watch.on_event) watch.on_event(event);
                           },
                       .on_progress = watch.on_progress,
                       .around_planner = {},
                       .on_plan = [&](const planners::Problem& problem, const planners::Plan& plan,
                                      const planners::PlanOrigin& origin) { journal.planned(problem, plan, origin); }},
                      std::move(stop));
}

jostle_msgs::msg::TaskRun describe_run(const jostle_msgs::msg::Goal& goal) {
  const std::chrono::duration<double> now = std::chrono::system_clock::now().time_since_epoch();
  jostle_msgs::msg::TaskRun run;
  run.header(world::make_header(now.count(), ""));
  run.goal(goal);
  run.build(common::build());
  run.engine(fmt::format("MuJoCo {}", physics_pool::engine_version()));
  run.middleware(fmt::format("Fast DDS {}", wire::middleware_version()));
  run.machine(common::processor());
  return run;
}

}  // namespace jostle::task
