#include "services/task/run/options.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <utility>

#include "physics_pool/uncertainty/belief.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/task/config/predictor.hpp"

namespace jostle::task {
namespace {

// An output that is an input, too, by whatever name, would be gone.
Result<void> keep_inputs(const GoalArguments& arguments, const RunOptions& options) {
  for (const auto& [option, output] : {std::pair("--json", options.json), std::pair("--picture", options.picture)}) {
    for (const std::filesystem::path& input : {std::filesystem::path(arguments.scene), arguments.parameters.file}) {
      std::error_code missing;
      if (output.empty() || input.empty() || !std::filesystem::equivalent(output, input, missing)) continue;
      return Error{Code::kInvalidArgument,
                   fmt::format("{}: got {}, which is read, too; wanted another file", option, output.string())};
    }
  }
  return {};
}

}  // namespace

void add_goal_options(CLI::App& app, GoalArguments& arguments, RunOptions& options) {
  app.add_option("scene", arguments.scene, "Scene file; `jostle scene generate` makes one")->required();
  auto* controller = app.add_option("--controller", options.controller,
                                    planners::controller_help() + " (default: the first that can do the task)");
  common::suggest(controller, planners::controller_names());
  auto* predictor =
      app.add_option(
             "--predictor", options.predictor,
             "What plans of pushes are made with: fine, coarse[,MODEL], parareal:K[,MODEL][,split] or\n"
             "parareal:adaptive[,MODEL][,split]; MODEL is kinematic, limit-surface, planar, learned or learned:FILE")
          ->capture_default_str();
  common::suggest(predictor,
                  {"fine", "coarse", "coarse,learned", "parareal:1", "parareal:1,learned", "parareal:adaptive"});
  auto* uncertainty = app.add_option("--uncertainty", arguments.level,
                                     "How wrong the planner's belief about the world is: none, low, medium or high")
                          ->capture_default_str();
  common::suggest(uncertainty, {"none", "low", "medium", "high"});
  common::add_seed_option(app, "--seed", options.seed, "Seed of all noise, the planner's and the world's");
  app.add_option("--parameters", arguments.parameters.file,
                 "Parameter file (YAML) of planner and controller; what it leaves out keeps its default.\n"
                 "`jostle parameters` lists keys and defaults");
  app.add_option("--set", arguments.parameters.settings,
                 "One parameter, such as planner.rollouts=4; may be given again")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  app.add_option("--timeout", arguments.parameters.timeout,
                 "Seconds for planning and acting together, the same as --set control.timeout=…\n(default: 900; of "
                 "tampc, uampc and slow-mpc 180)");
  app.add_option("--json", options.json, "File for the result; docs/results.md says what its keys are");
  app.add_option("--picture", options.picture, "PNG of the execution");
  app.add_flag("--plan-only", options.plan_only, "Stop after the first plan");
  app.add_flag("--headless", options.headless, "Plain lines instead of a live display");
  common::add_network_options(app);
  app.add_option("--domain", options.domain, "DDS domain (default: ROS_DOMAIN_ID, else 0)");
  app.footer(
      "Exit codes: 0 grasped or pushed to its goal, 1 not, 2 bad input, 3 a part of the system failed or the\n"
      "recording is not complete, 130 interrupted.");
}

Result<void> complete(const GoalArguments& arguments, RunOptions& options) {
  if (auto ok = common::check_outputs({{"--json", options.json, {}},
                                       {"--picture", options.picture, {".png"}},
                                       {"--record", options.record, {}, true}});
      !ok) {
    return ok;
  }
  if (auto ok = keep_inputs(arguments, options); !ok) return ok;
  auto level_result = physics_pool::parse_uncertainty(arguments.level);
  if (!level_result) return level_result.error();
  options.level = *level_result;
  auto scene_result = physics_pool::load_scene(arguments.scene);
  if (!scene_result) return scene_result.error();
  options.scene = std::move(scene_result).value();
  options.planning = physics_pool::perturb(options.scene, options.level, options.seed);
  const auto controller_result = planners::find_controller(options.controller, options.planning);
  if (!controller_result) return Error{controller_result.error().code, "--" + controller_result.error().message};
  const planners::ControllerKind* kind = *controller_result;
  options.controller = kind->name;
  if (auto ok = Predictor::check(options.predictor, options.planning); !ok)
    return Error{ok.error().code, "--" + ok.error().message};
  auto standard_result = standard_parameters(*kind, &options.planning);
  if (!standard_result) return standard_result.error();
  options.noise = arguments.noise.value_or(0.0);
  ParameterOptions chosen = arguments.parameters;
  if (arguments.noise)  // before what the user sets: the last setting of a key counts
    chosen.settings.insert(chosen.settings.begin(), fmt::format("adaptive.noise={}", *arguments.noise));
  auto parameters_result = choose_parameters(*kind, chosen, &options.planning);
  if (!parameters_result) return parameters_result.error();
  options.parameters = to_yaml(*parameters_result);
  options.changed = differences(*standard_result, *parameters_result);
  return check_fit(*parameters_result, options.planning);
}

jostle_msgs::msg::Goal make_goal(const RunOptions& options) {
  jostle_msgs::msg::Goal goal;
  goal.execution_scene(physics_pool::to_yaml(options.scene));
  goal.planning_scene(physics_pool::to_yaml(options.planning));
  goal.parameters(options.parameters);
  goal.controller(options.controller);
  goal.predictor(options.predictor);
  goal.seed(options.seed);
  goal.plan_only(options.plan_only);
  return goal;
}

}  // namespace jostle::task
