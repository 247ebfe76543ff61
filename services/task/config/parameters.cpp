#include "services/task/config/parameters.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "idl/text/yaml_fields.hpp"
#include "services/common/process/files.hpp"
#include "services/task/config/parameter_keys.hpp"

namespace jostle::task {
namespace {

bool in_range(const ParameterKey& key, double value) { return value >= key.least && value <= key.most; }  // not NaN

bool in_range(const ParameterKey& key, const ParameterValue& value) {
  return std::visit(
      [&]<class T>(const T& v) {
        if constexpr (std::is_same_v<T, std::vector<double>>) {
          return std::ranges::all_of(v, [&](double number) { return in_range(key, number); });
        } else if constexpr (std::is_same_v<T, std::string>) {
          return std::ranges::find(key.words, v) != key.words.end();
        } else {
          return in_range(key, static_cast<double>(v));
        }
      },
      value);
}

void read_as(const char* name, const ParameterKey& key, yaml::Fields& in, Parameters& parameters) {
  ParameterValue value = key.get(parameters);
  std::visit([&](auto& v) { in.optional(name, v); }, value);
  if (!in.has(name)) return;
  if (!in_range(key, value)) {
    const std::string got = key.words.empty() ? to_text(value) : "'" + to_text(value) + "'";
    in.refuse(name, fmt::format("got {}, wanted {}", got, key.wanted()));
  }
  key.set(parameters, value);
}

// Reads every key of a file that has the sections of the table.
void read(const YAML::Node& root, const std::string& origin, Parameters& parameters) {
  std::map<std::string, std::vector<ParameterKey>> sections;
  for (ParameterKey& key : parameter_keys()) sections[key.section].push_back(std::move(key));
  const auto read_section = [&](yaml::Fields& in, const std::vector<ParameterKey>& keys) {
    for (const ParameterKey& key : keys) {
      if (!key.also.empty()) read_as(key.also.c_str(), key, in, parameters);
      read_as(key.name.c_str(), key, in, parameters);
    }
  };
  yaml::Fields fields(root, "", origin);
  for (const auto& section : sections) {
    if (section.first.empty()) {
      read_section(fields, section.second);
    } else {
      fields.section(section.first.c_str(), false, [&](yaml::Fields& in) { read_section(in, section.second); });
    }
  }
  fields.finish();
  planners::ControlOptions& control = parameters.controller.control;
  control.step_duration = parameters.controller.mpc.step_duration = parameters.planner.step_duration;
  control.min_steps = parameters.planner.min_steps;
  parameters.controller.adaptive.step_duration = parameters.planner.step_duration;
  parameters.controller.robust.step_duration = parameters.planner.step_duration;
}

// What one key alone cannot be wrong in.
Result<void> check(const Parameters& parameters, const std::string& origin) {
  const planners::PbstoOptions& planner = parameters.planner;
  if (planner.sigma.empty() || planner.sigma.size() != planner.limit.size()) {
    return invalid(origin + ": planner.sigma",
                   fmt::format("{} numbers and {} of planner.limit", planner.sigma.size(), planner.limit.size()),
                   "one of each for every axis of the robot");
  }
  const planners::AdaptiveOptions& adaptive = parameters.controller.adaptive;
  if (adaptive.least_actions > adaptive.most_actions) {
    return invalid(origin + ": adaptive.least_actions", std::to_string(adaptive.least_actions),
                   fmt::format("at most adaptive.most_actions, {}", adaptive.most_actions));
  }
  const physics_pool::ParameterBounds& bounds = parameters.controller.robust.planner.bounds;
  if (bounds.least_mass > bounds.most_mass) {
    return invalid(origin + ": robust.least_mass", fmt::format("{}", bounds.least_mass),
                   fmt::format("at most robust.most_mass, {}", bounds.most_mass));
  }
  if (bounds.least_friction > bounds.most_friction) {
    return invalid(origin + ": robust.least_friction", fmt::format("{}", bounds.least_friction),
                   fmt::format("at most robust.most_friction, {}", bounds.most_friction));
  }
  if (planner.scales.empty()) return invalid(origin + ": planner.scales", "an empty list", "at least one factor");
  if (double(planner.rollouts) * planner.screening > physics_pool::kMaxSamples) {
    return invalid(origin + ": planner.rollouts times planner.screening",
                   fmt::format("{}", double(planner.rollouts) * planner.screening),
                   fmt::format("at most {}", physics_pool::kMaxSamples));
  }
  const double steps = planner.step_duration / planner.screening_time_step;
  if (planner.screening > 1 && std::abs(steps - std::round(steps)) > 1e-6 * steps) {
    return invalid(origin + ": planner.screening_time_step", fmt::format("{} s", planner.screening_time_step),
                   fmt::format("a part of step_duration, {} s, without remainder", planner.step_duration));
  }
  return {};
}

Result<Parameters> read_and_check(const YAML::Node& root, const std::string& origin, Parameters parameters) {
  read(root, origin, parameters);
  if (auto ok = check(parameters, origin); !ok) return ok.error();
  return parameters;
}

// Finds a key of this name in whatever section, for somebody who left the section out.
std::string key_meant(std::string_view name) {
  for (const ParameterKey& key : parameter_keys()) {
    if (!key.section.empty() && key.name == name) return key.path();
  }
  return {};
}

// Puts one setting into the tree that a file with it would have.
Result<void> add_setting(const std::string& setting, YAML::Node root) {
  const auto equals = setting.find('=');
  if (equals == setting.npos || equals == 0 || equals + 1 == setting.size()) {
    return invalid("--set", "'" + setting + "'",
                   "KEY=VALUE, such as planner.rollouts=4; `jostle parameters` lists the keys");
  }
  const std::string path = setting.substr(0, equals);
  if (const std::string meant = key_meant(path); !meant.empty()) {
    return invalid("--set", "the key '" + path + "'", "'" + meant + "'");
  }
  try {
    const YAML::Node value = YAML::Load(setting.substr(equals + 1));
    const auto dot = path.find('.');
    if (dot == path.npos) {
      root[path] = value;
    } else {
      root[path.substr(0, dot)][path.substr(dot + 1)] = value;
    }
  } catch (const YAML::Exception&) {
    return invalid("--set " + path, "'" + setting.substr(equals + 1) + "'",
                   "a value as in a file, such as 8 or [0.1, 0.1]");
  }
  return {};
}

// A command line has no lines: "--set:1: planner.lambda: …" loses its number.
std::string without_line(std::string message, const std::string& origin) {
  if (!message.starts_with(origin + ":")) return message;
  const auto after = message.find_first_not_of("0123456789", origin.size() + 1);
  return after == message.npos ? message : message.replace(origin.size(), after + 1 - origin.size(), "");
}

// The files' lists are for x, y, rotation and the hand. Makes them those of a robot's own axes: one that a file does
// not name is held still.
void fit_axes(const physics_pool::RobotModel& model, const physics_pool::PlanarRobot& planar,
              planners::PbstoOptions& planner) {
  const std::vector<double> sigma = std::exchange(planner.sigma, {}), limit = std::exchange(planner.limit, {});
  for (int i = 0; i < static_cast<int>(model.axes.size()); ++i) {
    const std::size_t named = i == planar.x ? 0u : i == planar.y ? 1u : i == planar.rotation ? 2u : 3u;
    const double most = model.axes[static_cast<std::size_t>(i)].limit;
    planner.sigma.push_back(named < sigma.size() ? sigma[named] : 0.0);
    planner.limit.push_back(named < limit.size() ? std::min(limit[named], most) : most);
  }
}

}  // namespace

Result<Parameters> parse_parameters(std::string_view text, const std::string& origin, const Parameters& base) {
  return yaml::parse<Parameters>(text, origin,
                                 [&](const YAML::Node& root) { return read_and_check(root, origin, base); });
}

Result<Parameters> load_parameters(const std::filesystem::path& file, const Parameters& base) {
  auto text_result = common::read_text(file);
  if (!text_result) return text_result.error();
  return parse_parameters(*text_result, file.string(), base);
}

Result<Parameters> with_settings(const Parameters& base, const std::vector<std::string>& settings) {
  if (settings.empty()) return base;
  const std::string origin = "--set";
  YAML::Node root(YAML::NodeType::Map);
  for (const std::string& setting : settings) {
    if (auto ok = add_setting(setting, root); !ok) return ok.error();
  }
  auto result =
      yaml::read<Parameters>(root, origin, [&](const YAML::Node& node) { return read_and_check(node, origin, base); });
  if (!result) return Error{result.error().code, without_line(result.error().message, origin)};
  return result;
}

Result<Parameters> standard_parameters(const planners::ControllerKind& controller, const physics_pool::Scene* scene) {
  auto parameters_result = load_parameters(common::data_file(controller.parameters));
  if (!parameters_result || !scene) return parameters_result;
  if (const auto planar = as_planar(scene->robot.model)) {
    fit_axes(scene->robot.model, *planar, parameters_result->planner);
    return parameters_result;
  }
  if (!controller.arm_parameters) return parameters_result;
  return load_parameters(common::data_file(controller.arm_parameters), *parameters_result);
}

Result<Parameters> choose_parameters(const planners::ControllerKind& controller, const ParameterOptions& options,
                                     const physics_pool::Scene* scene) {
  auto parameters_result = standard_parameters(controller, scene);
  if (parameters_result && !options.file.empty()) parameters_result = load_parameters(options.file, *parameters_result);
  if (!parameters_result) return parameters_result;
  std::vector<std::string> settings = options.settings;
  if (options.timeout) settings.push_back(fmt::format("control.timeout={}", *options.timeout));
  return with_settings(*parameters_result, settings);
}

std::string to_yaml(const Parameters& parameters) {
  std::string text, section;
  for (const ParameterKey& key : parameter_keys()) {
    if (key.section != section) text += (section = key.section) + ":\n";
    text += fmt::format("{}{}: {}\n", section.empty() ? "" : "  ", key.name, to_text(key.get(parameters)));
  }
  return text;
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
                 fmt::format("{} for the robot '{}': {}; without planner.sigma and planner.limit it has its own",
                             axes.size(), scene.robot.model.name, fmt::join(names, ", ")));
}

}  // namespace jostle::task
