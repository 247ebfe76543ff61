#pragma once
/// \file
/// What `jostle run` was asked for.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "physics_pool/scene/scene.hpp"
#include "physics_pool/uncertainty/levels.hpp"
#include "services/task/config/parameter_keys.hpp"

namespace jostle::task {

struct RunOptions {
  physics_pool::Scene scene;                 ///< execution world
  physics_pool::Scene planning;              ///< what the planner believes
  std::string parameters;                    ///< YAML text, complete
  std::vector<ParameterDifference> changed;  ///< what differs from the controller's own parameters
  physics_pool::Uncertainty level = physics_pool::Uncertainty::kNone;
  std::string controller;          ///< a name of planners/controllers/catalogue.hpp
  std::string predictor = "fine";  ///< see services/task/config/predictor.hpp
  std::string pool = "dds";
  int workers = 2;
  std::vector<int> cores;  ///< dealt to the workers in turn; empty: not pinned
  std::uint64_t seed = 1;
  double rate = 0.0;  ///< of the simulated world; 0: as fast as possible
  bool plan_only = false;
  bool headless = false;  ///< plain lines instead of a live display
  std::optional<int> domain;
  std::filesystem::path json, picture;  ///< empty: none
  std::filesystem::path record;         ///< a bag's folder; empty: nothing is recorded
};

}  // namespace jostle::task
