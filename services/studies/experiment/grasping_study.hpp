#pragma once
/// \file
/// The study of Fig. 3.5: generated scenes, uncertainty levels, controllers.

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "idl/text/yaml_fields.hpp"
#include "idl/types/result.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/studies/experiment/study.hpp"
#include "services/task/config/parameters.hpp"

namespace jostle::studies {

/// What a file of experiments/ defines.
struct GraspingStudy {
  std::string title;
  task::Parameters parameters;
  int objects = 15;
  std::uint64_t first_seed = 1, last_seed = 10;
  std::vector<std::string> levels;       ///< none, low, medium, high
  std::vector<std::string> controllers;  ///< or, nr
  /// Success rates of the thesis: level, then controller; may have gaps.
  std::map<std::string, std::map<std::string, double>> thesis;
};

/// Reads a study whose file says `study: grasping`; `origin` is that file.
Result<std::unique_ptr<Study>> read_grasping_study(yaml::Fields& fields, const std::string& origin);

/// One scene planned and executed once.
struct GraspingRun {
  std::uint64_t seed = 0;
  std::string level, controller;
  std::string error;  ///< not empty if the system itself failed
  planners::Outcome outcome;
  double execution_cost = 0.0;  ///< Eq. 3.2 over the observed states, without c_a
};

/// Runs every combination, options.jobs at a time, each with a pool of one thread.
/// The world stands still while its planner thinks. `on_run` is called from
/// one thread at a time. Results are in order of level, controller, seed and
/// do not depend on jobs.
std::vector<GraspingRun> run_study(const GraspingStudy& study, const StudyOptions& options,
                                   const std::function<void(const GraspingRun&)>& on_run);

/// Writes a table with one row per level and controller, beside the thesis's numbers.
std::string study_table(const GraspingStudy& study, const std::vector<GraspingRun>& runs);
nlohmann::json study_json(const GraspingStudy& study, const std::vector<GraspingRun>& runs);

}  // namespace jostle::studies
