#pragma once
/// \file
/// Parameters of planners and controllers: the defaults of `jostle run`, files, and settings of the command line.
/// parameter_keys.hpp has the table of keys; `jostle parameters` prints it, docs/parameters.md is what it prints.

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.hpp"
#include "planners/controllers/catalogue.hpp"
#include "planners/guided/guided.hpp"
#include "planners/pbsto/pbsto.hpp"

namespace jostle::task {

struct Parameters {
  planners::PbstoOptions planner;
  /// planner.guidance…: with candidates, `planner` gives noise, limits and n_min only.
  planners::GuidanceOptions guidance;
  physics_pool::Objective objective = physics_pool::Objective::standard();
  planners::ControllerOptions controller;
  planners::RunLimits limits;
  double plan_while_acting = 0.0;  ///< m, see ControlSetup
};

/// Returns `base` with what a file changes. Keys that the file leaves out stay as they are; unknown keys are refused.
/// Errors   kInvalidArgument naming file, line and key; load_parameters also kIo
Result<Parameters> parse_parameters(std::string_view yaml, const std::string& origin, const Parameters& base = {});
Result<Parameters> load_parameters(const std::filesystem::path& file, const Parameters& base = {});

/// Returns `base` with settings such as "planner.rollouts=4" or "planner.sigma=[0.1, 0.1]", the last of a key counting.
/// Error kInvalidArgument naming the setting, and a key that may be meant.
Result<Parameters> with_settings(const Parameters& base, const std::vector<std::string>& settings);

/// Returns what a controller runs with where nobody says anything else: its own parameter file, and what the one for
/// arms changes of it if the scene has an arm. planner.sigma and planner.limit are of the axes that the scene's robot
/// has. `scene`: null for the planar gripper. Errors   those of load_parameters
Result<Parameters> standard_parameters(const planners::ControllerKind& controller,
                                       const physics_pool::Scene* scene = nullptr);

/// What a command line says of parameters: each changes what it names of the one before.
struct ParameterOptions {
  std::filesystem::path file;         ///< empty: none
  std::vector<std::string> settings;  ///< KEY=VALUE
  std::optional<double> timeout;      ///< control.timeout, s
};

/// Returns the standard parameters with these options.
/// Errors   those of load_parameters and with_settings
Result<Parameters> choose_parameters(const planners::ControllerKind& controller, const ParameterOptions& options,
                                     const physics_pool::Scene* scene = nullptr);

/// Returns all parameters as a file, which parse_parameters reads back bit-equal.
std::string to_yaml(const Parameters& parameters);

/// Whether parameters have numbers for every axis of a scene's robot.
/// Error kInvalidArgument naming the axes.
Result<void> check_fit(const Parameters& parameters, const physics_pool::Scene& scene);

}  // namespace jostle::task
