#pragma once
/// \file
/// The study of Fig. 3.5: generated scenes, uncertainty levels, controllers.

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "physics_pool/scene/generate.hpp"
#include "services/support/statistics.hpp"
#include "services/config/parameters.hpp"

namespace jostle::services {

/// What a file of experiments/ defines.
struct GraspingStudy {
  std::string title;
  Parameters parameters;
  int objects = 15;
  std::uint64_t first_seed = 1, last_seed = 10;
  std::vector<std::string> levels;       ///< none, low, medium, high
  std::vector<std::string> controllers;  ///< or, nr
  /// Success rates of the thesis: level, then controller; may have gaps.
  std::map<std::string, std::map<std::string, double>> thesis;
};

/// `name` such as "fig-3.5": a file of the data folder experiments/.
Result<GraspingStudy> load_grasping_study(const std::string& name);

/// One scene planned and executed once.
struct GraspingRun {
  std::uint64_t seed = 0;
  std::string level, controller;
  std::string error;  ///< not empty if the system itself failed
  planners::Outcome outcome;
  double execution_cost = 0.0;  ///< Eq. 3.2 over the observed states, without c_a
};

/// Runs every combination, `jobs` at a time, each with a pool of one thread.
/// The world stands still while its planner thinks. `on_run` is called from
/// one thread at a time. Results are in order of level, controller, seed and
/// do not depend on `jobs`.
std::vector<GraspingRun> run_study(const GraspingStudy& study, int jobs,
                                   const std::function<void(const GraspingRun&)>& on_run);

/// A table with one row per level and controller, beside the thesis's numbers.
std::string study_table(const GraspingStudy& study, const std::vector<GraspingRun>& runs);
std::string study_json(const GraspingStudy& study, const std::vector<GraspingRun>& runs);

}  // namespace jostle::services
