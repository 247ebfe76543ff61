#include "services/task/session/task.hpp"

#include <fmt/format.h>
#include <sys/utsname.h>

#include <chrono>
#include <fstream>

#include "physics_pool/local/simulator.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::task {
namespace {

using planners::ControlOptions;

Result<ControlOptions::Method> parse_controller(const std::string& name, const physics_pool::SceneTask& task) {
  if (task.is_push() && name == "mpc") return ControlOptions::Method::kOnline;  // asked of nobody
  if (!task.is_push() && name == "or") return ControlOptions::Method::kOnline;
  if (!task.is_push() && name == "nr") return ControlOptions::Method::kNaive;
  return Error{Code::kInvalidArgument, fmt::format("controller: got '{}' for a task to {}, wanted {}", name, task.kind,
                                                   task.is_push() ? "mpc" : "or, nr")};
}

// "x86_64, AMD EPYC 7B13": what floating-point results may depend on.
std::string processor() {
  utsname system{};
  uname(&system);
  std::ifstream in("/proc/cpuinfo");
  for (std::string line; std::getline(in, line);) {
    const auto colon = line.find(": ");
    if (line.starts_with("model name") && colon != std::string::npos) {
      return fmt::format("{}, {}", system.machine, line.substr(colon + 2));
    }
  }
  return system.machine;
}

}  // namespace

Task::Task(const jostle_msgs::msg::Goal& goal, physics_pool::Scene execution, physics_pool::WorldPtr believed,
           Parameters parameters, Predictor predictor, Hash world)
    : goal_id_(goal.goal_id()),
      seed_(goal.seed()),
      execution_(std::move(execution)),
      believed_(std::move(believed)),
      parameters_(std::move(parameters)),
      predictor_(std::move(predictor)),
      world_(world) {}

Result<Task> Task::prepare(const jostle_msgs::msg::Goal& goal, physics_pool::AsyncPool& pool,
                           std::function<void(const std::string&)> on_split) {
  auto execution_result = physics_pool::parse_scene(goal.execution_scene(), "goal.execution_scene");
  if (!execution_result) return execution_result.error();
  auto planning_result = physics_pool::parse_scene(goal.planning_scene(), "goal.planning_scene");
  if (!planning_result) return planning_result.error();
  auto parameters_result = parse_parameters(goal.parameters(), "goal.parameters");
  if (!parameters_result) return parameters_result.error();
  auto method_result = parse_controller(goal.controller(), planning_result->task);
  if (!method_result) return method_result.error();
  auto predictor_result =
      Predictor::make(goal.predictor().empty() ? "fine" : goal.predictor(), pool, std::move(on_split));
  if (!predictor_result) return predictor_result.error();
  auto world_result = predictor_result->pool().load(*planning_result);
  if (!world_result) return world_result.error();
  auto believed_result = physics_pool::World::compile(*planning_result);
  if (!believed_result) return believed_result.error();
  parameters_result->control.method = *method_result;
  parameters_result->control.plan_only = parameters_result->mpc.plan_only = goal.plan_only();
  return Task(goal, std::move(execution_result).value(), std::move(believed_result).value(),
              std::move(parameters_result).value(), std::move(predictor_result).value(), *world_result);
}

Result<planners::Outcome> Task::perform(robot_bridge::Robot& robot, perception::ObjectSource& objects,
                                        const Watch& watch, std::stop_token stop) {
  Journal journal(goal_id_, parameters_.planner.step_duration, watch.time, watch.journal);
  planners::Pbsto planner(predictor_.pool(), parameters_.planner, watch.on_progress);
  Journal::Robot journal_robot(journal, robot);
  Journal::Objects journal_objects(journal, objects);
  Journal::Planner journal_planner(journal, planner);
  planners::ControlSetup setup{.planner = journal_planner,
                               .robot = journal_robot,
                               .objects = journal_objects,
                               .geometry = geometry(),
                               .objective = parameters_.planner.objective,
                               .world = world_,
                               .seed = seed_};
  // Believed shapes at exact poses need no moving apart, and must not get it:
  // the plan for a perfectly known world starts from that very world.
  if (world_ != physics_pool::scene_hash(execution_)) {
    setup.make_feasible = [this](const State& x) { return physics_pool::separate(*believed_, x); };
  }
  if (geometry().task.is_push()) return planners::run_mpc(setup, parameters_.mpc, watch.on_event, std::move(stop));
  return planners::run_controller(setup, parameters_.control, watch.on_event, std::move(stop));
}

jostle_msgs::msg::TaskRun describe_run(const jostle_msgs::msg::Goal& goal) {
  const std::chrono::duration<double> now = std::chrono::system_clock::now().time_since_epoch();
  jostle_msgs::msg::TaskRun run;
  run.header(world::make_header(now.count(), ""));
  run.goal(goal);
  run.build(fmt::format("Jostle {}, GCC {}, {}", JOSTLE_VERSION, __VERSION__, JOSTLE_BUILD_TYPE));
  run.engine(fmt::format("MuJoCo {}", physics_pool::engine_version()));
  run.middleware(fmt::format("Fast DDS {}", wire::middleware_version()));
  run.machine(processor());
  return run;
}

}  // namespace jostle::task
