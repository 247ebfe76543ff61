#pragma once
/// \file
/// The studies of Fig. 5.3 and 5.4: the same tasks with task-adaptive control and its baselines, per level of noise.

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "idl/text/yaml_fields.hpp"
#include "services/studies/experiment/study.hpp"
#include "services/task/config/parameters.hpp"

namespace jostle::studies {

/// What a file of experiments/ defines.
struct AdaptiveStudy {
  StudyAbout about;
  task::Parameters parameters;
  std::vector<std::string> tasks;  ///< those of generate_chapter5
  /// Names of controllers. After a colon may stand the b that a controller's planner believes in, such as
  /// "tampc:0.075"; otherwise it knows the world's.
  std::vector<std::string> methods;
  std::vector<double> levels;  ///< b of Eq. 5.10, of the world
  std::uint64_t first_seed = 1001, last_seed = 1050;
  bool shows_ways = false;  ///< the figure is the speed along the way (Fig. 5.4), not success and time (Fig. 5.3)
  /// By task and method: what the thesis says, in its words or numbers.
  std::map<std::string, std::map<std::string, std::string>> thesis;
  std::string remark;  ///< printed below the table
};

/// Reads a study whose file says `study: adaptive`; `origin` is that file. A case is one scene with one method at one
/// level. Seeds are in the outer loop, so that whatever part of a study was run compares all methods on equal scenes
/// with equal noises. What limits a run is counted in actions and rollouts; no clock decides.
Result<std::unique_ptr<Study>> read_adaptive_study(yaml::Fields& fields, const std::string& origin);

}  // namespace jostle::studies
