#pragma once
/// \file
/// The study of Fig. 3.5: generated scenes, uncertainty levels, controllers.

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "idl/text/yaml_fields.hpp"
#include "idl/types/result.hpp"
#include "services/studies/experiment/study.hpp"
#include "services/task/config/parameters.hpp"

namespace jostle::studies {

/// What a file of experiments/ defines.
struct GraspingStudy {
  StudyAbout about;
  task::Parameters parameters;
  int objects = 15;
  std::uint64_t first_seed = 1, last_seed = 10;
  std::vector<std::string> levels;       ///< none, low, medium, high
  std::vector<std::string> controllers;  ///< or, nr
  /// Success rates of the thesis: level, then controller; may have gaps.
  std::map<std::string, std::map<std::string, double>> thesis;
};

/// Reads a study whose file says `study: grasping`; `origin` is that file. A case is one scene, planned and executed
/// once: with a pool of one thread, and in a world that stands still while its planner thinks.
/// So results do not depend on how many run side by side.
Result<std::unique_ptr<Study>> read_grasping_study(yaml::Fields& fields, const std::string& origin);

}  // namespace jostle::studies
