#pragma once
/// \file
/// Parameters of planners and controllers as files. `experiments/chapter3.yaml` and
/// `experiments/pushing.yaml` document every key.

#include <filesystem>
#include <string>
#include <string_view>

#include "idl/types/result.hpp"
#include "planners/controllers/catalogue.hpp"
#include "planners/pbsto/pbsto.hpp"

namespace jostle::task {

struct Parameters {
  planners::PbstoOptions planner;
  physics_pool::Objective objective = physics_pool::Objective::standard();
  planners::ControllerOptions controller;
  planners::RunLimits limits;
};

/// Keys that a file leaves out keep their defaults; unknown keys are refused.
Result<Parameters> parse_parameters(std::string_view yaml, const std::string& origin);
Result<Parameters> load_parameters(const std::filesystem::path& file);

/// Whether parameters have numbers for every axis of a scene's robot.
/// Error kInvalidArgument naming the axes.
Result<void> check_fit(const Parameters& parameters, const physics_pool::Scene& scene);

}  // namespace jostle::task
