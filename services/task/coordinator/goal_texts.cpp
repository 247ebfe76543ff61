#include "services/task/coordinator/goal_texts.hpp"

#include <fmt/format.h>

#include <utility>

#include "physics_pool/scene/scene.hpp"
#include "planners/controllers/catalogue.hpp"
#include "services/task/config/parameters.hpp"
#include "services/wire/limits.hpp"

namespace jostle::task {

namespace limits = wire::limits;

Result<void> check_sizes(const jostle_msgs::msg::Goal& goal) {
  const std::pair<const char*, const std::string&> texts[] = {{"goal.execution_scene", goal.execution_scene()},
                                                              {"goal.planning_scene", goal.planning_scene()},
                                                              {"goal.parameters", goal.parameters()}};
  for (const auto& [field, text] : texts) {
    if (text.size() <= limits::kText) continue;
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: got {} bytes, wanted at most {}", field, text.size(), limits::kText)};
  }
  return {};
}

Result<jostle_msgs::msg::Goal> complete(jostle_msgs::msg::Goal goal, std::string_view kind) {
  if (auto ok = check_sizes(goal); !ok) return ok.error();
  auto scene_result = physics_pool::parse_scene(goal.execution_scene(), "goal.execution_scene");
  if (!scene_result) return scene_result.error();
  if (scene_result->task.kind != kind)
    return invalid("goal.execution_scene: task.kind", "'" + scene_result->task.kind + "'",
                   fmt::format("'{}', or the action /{}", kind, scene_result->task.kind));
  if (goal.planning_scene().empty()) goal.planning_scene(goal.execution_scene());
  auto planning_result = physics_pool::parse_scene(goal.planning_scene(), "goal.planning_scene");
  if (!planning_result) return planning_result.error();
  const auto controller_result = planners::find_controller(goal.controller(), *planning_result);
  if (!controller_result) return Error{controller_result.error().code, "goal." + controller_result.error().message};
  goal.controller((*controller_result)->name);
  if (goal.predictor().empty()) goal.predictor("fine");
  const auto standard_result = standard_parameters(**controller_result);
  if (!standard_result) return standard_result.error();
  const auto parameters_result = parse_parameters(goal.parameters(), "goal.parameters", *standard_result);
  if (!parameters_result) return parameters_result.error();
  goal.parameters(to_yaml(*parameters_result));
  return goal;
}

}  // namespace jostle::task
