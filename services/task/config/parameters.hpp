#pragma once
/// \file
/// Parameters of planners and controllers as files. `experiments/chapter3.yaml` and
/// `experiments/pushing.yaml` document every key.

#include <filesystem>
#include <string>
#include <string_view>

#include "idl/types/result.hpp"
#include "planners/control/controller.hpp"
#include "planners/mpc/mpc.hpp"
#include "planners/pbsto/pbsto.hpp"

namespace jostle::task {

struct Parameters {
  planners::PbstoOptions planner;
  planners::ControlOptions control;  ///< grasping
  planners::MpcOptions mpc;          ///< pushing
};

/// Keys that a file leaves out keep their defaults; unknown keys are refused.
Result<Parameters> parse_parameters(std::string_view yaml, const std::string& origin);
Result<Parameters> load_parameters(const std::filesystem::path& file);

}  // namespace jostle::task
