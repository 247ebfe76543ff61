#include "services/task/config/parameters.hpp"

#include <cmath>

#include "idl/text/yaml_fields.hpp"
#include "physics_pool/objective/catalogue.hpp"
#include "services/common/process/files.hpp"

namespace jostle::task {
namespace {

using planners::ControlOptions;
using planners::PbstoOptions;

// Every kind of the catalogue by its name, every parameter as KIND_NAME; `angle` is what goal_angle was called.
void read_objective(yaml::Fields& in, physics_pool::Objective& objective) {
  for (const physics_pool::TermKind* kind : physics_pool::term_catalogue()) {
    in.optional(kind->name, objective[kind->name].weight);
    for (const physics_pool::TermParameter& parameter : kind->parameters) {
      in.optional(fmt::format("{}_{}", kind->name, parameter.name).c_str(),
                  objective.value(kind->name, parameter.name));
    }
  }
  in.optional("angle", objective.value("goal", "angle"));
  in.optional("success_cost", objective.success_cost);
}

// `timeout` is checked before it becomes a duration, s.
Parameters read(const YAML::Node& root, const std::string& origin, double& timeout) {
  Parameters parameters;
  PbstoOptions& planner = parameters.planner;
  ControlOptions& control = parameters.controller.control;
  planners::MpcOptions& mpc = parameters.controller.mpc;
  yaml::Fields fields(root, "", origin);
  fields.optional("step_duration", planner.step_duration);
  fields.optional("min_steps", planner.min_steps);
  fields.section("planner", false, [&](yaml::Fields& in) {
    in.optional("rollouts", planner.rollouts);
    in.optional("sigma", planner.sigma);
    in.optional("limit", planner.limit);
    in.optional("scales", planner.scales);
    in.choice<PbstoOptions::Update>(
        "update", planner.update,
        {{"greedy", PbstoOptions::Update::kGreedy}, {"cost-weighted", PbstoOptions::Update::kCostWeighted}});
    in.optional("lambda", planner.lambda);
    in.optional("persistence", planner.persistence);
    in.optional("stop_losers", planner.stop_losers);
    in.optional("stop_hopeless", planner.stop_hopeless);
    in.optional("freeze", planner.freeze);
    in.optional("screening", planner.screening);
    in.optional("screening_time_step", planner.screening_time_step);
  });
  fields.section("objective", false, [&](yaml::Fields& in) { read_objective(in, parameters.objective); });
  fields.section("control", false, [&](yaml::Fields& in) {
    in.optional("many_iterations", control.many_iterations);
    in.optional("few_iterations", control.few_iterations);
    in.optional("few_iterations_max", control.few_iterations_max);
    in.optional("deviation_threshold", control.deviation_threshold);
    in.optional("obstruction_patience", control.obstruction_patience);
    in.optional("initial_steps", control.initial_steps);
    in.optional("straight_speed", control.straight_speed);
    in.optional("close_hand", control.close_hand);
    in.optional("timeout", timeout);
    int max_rollouts = 0;
    in.optional("max_rollouts", max_rollouts);
    if (max_rollouts < 0)
      in.refuse("max_rollouts", fmt::format("got {}, wanted 0, for no limit, or more", max_rollouts));
    parameters.limits.rollouts = static_cast<std::uint64_t>(max_rollouts);
  });
  fields.section("mpc", false, [&](yaml::Fields& in) {
    in.optional("horizon", mpc.horizon);
    in.optional("first_iterations", mpc.first_iterations);
    in.optional("iterations", mpc.iterations);
    in.optional("max_actions", mpc.max_actions);
    in.optional("straight_speed", mpc.straight_speed);
  });
  fields.finish();
  control.step_duration = mpc.step_duration = planner.step_duration;
  control.min_steps = planner.min_steps;
  return parameters;
}

// A key, its value and the closed range it must lie in.
struct Range {
  const char* key;
  double value, low, high;
};

// What no batch carries, and the objective, which is better refused where it is written.
Result<void> check(const Parameters& parameters, double timeout, const std::string& origin) {
  const PbstoOptions& planner = parameters.planner;
  const ControlOptions& control = parameters.controller.control;
  const planners::MpcOptions& mpc = parameters.controller.mpc;
  for (const Range& range :
       {Range{"planner.rollouts", double(planner.rollouts), 1, physics_pool::kMaxSamples},
        Range{"planner.screening", double(planner.screening), 1, 1e4},
        Range{"planner.screening_time_step", planner.screening_time_step, 1e-4, physics_pool::kMaxTimeStep},
        Range{"planner.lambda", planner.lambda, 1e-9, 1e12},
        Range{"min_steps", double(planner.min_steps), 0, physics_pool::kMaxSteps},
        Range{"step_duration", planner.step_duration, 1e-3, physics_pool::kMaxStepDuration},
        Range{"control.many_iterations", double(control.many_iterations), 0, 1e6},
        Range{"control.few_iterations", double(control.few_iterations), 0, 1e6},
        Range{"control.few_iterations_max", double(control.few_iterations_max), 0, 1e6},
        Range{"control.obstruction_patience", double(control.obstruction_patience), 0, 1e6},
        Range{"control.deviation_threshold", control.deviation_threshold, 0, 1e6},
        Range{"control.initial_steps", double(control.initial_steps), 1, physics_pool::kMaxSteps},
        Range{"control.straight_speed", control.straight_speed, 0, 1},
        Range{"mpc.horizon", double(mpc.horizon), 1, physics_pool::kMaxSteps},
        Range{"mpc.first_iterations", double(mpc.first_iterations), 0, 1e6},
        Range{"mpc.iterations", double(mpc.iterations), 0, 1e6},
        Range{"mpc.max_actions", double(mpc.max_actions), 1, 1e6},
        Range{"mpc.straight_speed", mpc.straight_speed, 0, 1}, Range{"control.timeout", timeout, 1, 1e6}}) {
    if (range.value >= range.low && range.value <= range.high) continue;  // false for NaN
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: {}: got {}, wanted {} to {}", origin, range.key, range.value, range.low, range.high)};
  }
  if (planner.sigma.empty() || planner.sigma.size() != planner.limit.size()) {
    return Error{
        Code::kInvalidArgument,
        fmt::format("{}: planner.sigma: got {} numbers and {} of planner.limit, wanted one of each for every axis "
                    "of the robot",
                    origin, planner.sigma.size(), planner.limit.size())};
  }
  if (auto ok = physics_pool::validate(parameters.objective); !ok) {
    return Error{ok.error().code, fmt::format("{}: {}", origin, ok.error().message)};
  }
  if (double(planner.rollouts) * planner.screening > physics_pool::kMaxSamples) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: planner.rollouts times planner.screening: got {}, wanted at most {}", origin,
                             double(planner.rollouts) * planner.screening, physics_pool::kMaxSamples)};
  }
  const double steps = planner.step_duration / planner.screening_time_step;
  if (planner.screening > 1 && std::abs(steps - std::round(steps)) > 1e-6 * steps) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}: planner.screening_time_step: got {} s, wanted a part of step_duration, {} s, "
                             "without remainder",
                             origin, planner.screening_time_step, planner.step_duration)};
  }
  return {};
}

}  // namespace

Result<Parameters> parse_parameters(std::string_view text, const std::string& origin) {
  return yaml::parse<Parameters>(text, origin, [&](const YAML::Node& root) -> Result<Parameters> {
    double timeout = std::chrono::duration<double>(planners::RunLimits{}.timeout).count();
    Parameters parameters = read(root, origin, timeout);
    if (auto ok = check(parameters, timeout, origin); !ok) return ok.error();
    parameters.limits.timeout = std::chrono::milliseconds(std::llround(timeout * 1e3));
    return parameters;
  });
}

Result<Parameters> load_parameters(const std::filesystem::path& file) {
  auto text_result = common::read_text(file);
  if (!text_result) return text_result.error();
  return parse_parameters(*text_result, file.string());
}

Result<void> check_fit(const Parameters& parameters, const physics_pool::Scene& scene) {
  const auto& axes = scene.robot.model.axes;
  if (parameters.planner.sigma.size() == axes.size()) {
    for (std::size_t i = 0; i < axes.size(); ++i) {
      if (parameters.planner.limit[i] <= axes[i].limit) continue;
      return invalid(fmt::format("parameters: planner.limit[{}]", i), fmt::format("{}", parameters.planner.limit[i]),
                     fmt::format("at most {}, the limit of axis '{}' of the robot '{}'", axes[i].limit, axes[i].name,
                                 scene.robot.model.name));
    }
    return {};
  }
  std::vector<std::string> names;
  for (const physics_pool::Axis& axis : axes) names.push_back(axis.name);
  return invalid("parameters: planner.sigma", fmt::format("{} numbers", parameters.planner.sigma.size()),
                 fmt::format("{} for the robot '{}': {}; experiments/ has files for grasping and for pushing",
                             axes.size(), scene.robot.model.name, fmt::join(names, ", ")));
}

}  // namespace jostle::task
