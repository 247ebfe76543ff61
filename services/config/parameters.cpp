#include "services/config/parameters.hpp"

#include "physics_pool/scene/yaml_fields.hpp"
#include "services/support/files.hpp"

namespace jostle::services {
namespace {

using planners::ControlOptions;
using planners::PbstoOptions;

void read_axes(yaml::Fields& fields, const char* key, std::vector<double>& values) {
  std::array<double, kControlAxes> axes{};
  std::copy_n(values.begin(), kControlAxes, axes.begin());
  fields.numbers(key, axes, false);
  values.assign(axes.begin(), axes.end());
}

Parameters read(const YAML::Node& root, const std::string& origin) {
  Parameters parameters;
  PbstoOptions& planner = parameters.planner;
  ControlOptions& control = parameters.control;
  physics_pool::Objective& objective = planner.objective;
  yaml::Fields fields(root, "", origin);
  fields.optional("step_duration", planner.step_duration);
  fields.optional("min_steps", planner.min_steps);
  fields.section("planner", false, [&](yaml::Fields& in) {
    in.optional("rollouts", planner.rollouts);
    read_axes(in, "sigma", planner.sigma);
    read_axes(in, "limit", planner.limit);
    in.choice<PbstoOptions::Update>("update", planner.update,
        {{"greedy", PbstoOptions::Update::kGreedy}, {"cost-weighted", PbstoOptions::Update::kCostWeighted}});
    in.optional("lambda", planner.lambda);
    in.optional("stop_losers", planner.stop_losers);
  });
  fields.section("objective", false, [&](yaml::Fields& in) {
    in.optional("goal", objective.goal);
    in.optional("angle", objective.angle);
    in.optional("acceleration", objective.acceleration);
    in.optional("disturbance", objective.disturbance);
    in.optional("disturbance_rotation", objective.disturbance_rotation);
    in.optional("edge", objective.edge);
    in.optional("edge_rate", objective.edge_rate);
    in.optional("edge_exponent_max", objective.edge_exponent_max);
    in.optional("edge_margin", objective.edge_margin);
    in.optional("topple", objective.topple);
    in.optional("topple_angle", objective.topple_angle);
    in.optional("drop", objective.drop);
    in.optional("drop_height", objective.drop_height);
    in.optional("success_cost", objective.success_cost);
  });
  fields.section("control", false, [&](yaml::Fields& in) {
    in.optional("many_iterations", control.many_iterations);
    in.optional("few_iterations", control.few_iterations);
    in.optional("deviation_threshold", control.deviation_threshold);
    in.optional("initial_steps", control.initial_steps);
    in.optional("straight_speed", control.straight_speed);
    in.optional("close_hand", control.close_hand);
    double timeout = std::chrono::duration<double>(control.timeout).count();
    in.optional("timeout", timeout);
    control.timeout = std::chrono::milliseconds(static_cast<long>(timeout * 1e3));
  });
  fields.finish();
  control.step_duration = planner.step_duration;
  control.min_steps = planner.min_steps;
  return parameters;
}

}  // namespace

Result<Parameters> parse_parameters(std::string_view text, const std::string& origin) {
  try {
    return read(YAML::Load(std::string(text)), origin);
  } catch (const yaml::Malformed& malformed) {
    return Error{Code::kInvalidArgument, malformed.message};
  } catch (const YAML::Exception& error) {
    return Error{Code::kInvalidArgument,
                 fmt::format("{}:{}: not YAML: {}", origin, error.mark.line + 1, error.msg)};
  }
}

Result<Parameters> load_parameters(const std::filesystem::path& file) {
  auto text_result = read_text(file);
  if (!text_result) return text_result.error();
  return parse_parameters(*text_result, file.string());
}

}  // namespace jostle::services
