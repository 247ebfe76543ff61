#pragma once
/// \file
/// What `jostle run` and `jostle goal` were asked for.

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "idl/msg/task.h"
#include "physics_pool/scene/scene.hpp"
#include "physics_pool/uncertainty/levels.hpp"
#include "services/task/config/parameter_keys.hpp"
#include "services/task/run/arm.hpp"
#include "services/world/link/mocap_faults.hpp"

namespace CLI {
class App;
}

namespace jostle::task {

struct RunOptions {
  physics_pool::Scene scene;                 ///< execution world
  physics_pool::Scene planning;              ///< what the planner believes
  std::string parameters;                    ///< YAML text, complete
  std::vector<ParameterDifference> changed;  ///< what differs from the controller's own parameters
  physics_pool::Uncertainty level = physics_pool::Uncertainty::kNone;
  std::string controller;          ///< a name of planners/controllers/catalogue.hpp
  std::string predictor = "fine";  ///< see services/task/config/predictor.hpp
  std::string pool = "dds";        ///< dds or threads; empty: that of a coordinator which runs already
  int workers = 2;
  std::vector<int> cores;  ///< dealt to the workers in turn; empty: not pinned
  std::uint64_t seed = 1;
  /// b of Eq. 5.10: slope of the simulated world's noise over the speed, beside that of `level`.
  double noise = 0.0;
  double rate = 0.0;                      ///< of the simulated world; 0: as fast as possible
  Arm arm;                                ///< what moves
  Sensor sensor;                          ///< who sees the objects
  world::MocapFaultOptions mocap_faults;  ///< of a motion capture that is simulated
  bool plan_only = false;
  bool headless = false;  ///< plain lines instead of a live display
  std::optional<int> domain;
  std::filesystem::path json, picture;  ///< empty: none
  std::filesystem::path record;         ///< a bag's folder; empty: nothing is recorded
  std::optional<std::uint16_t> view;    ///< port where the run is shown, 0: any; empty: it is not
};

/// What a command line says of a goal, as it was typed.
struct GoalArguments {
  std::string scene, level = "none";
  std::optional<double> noise;  ///< of `jostle run`, whose world is its own
  ParameterOptions parameters;
};

/// Adds the options of a goal and of what is left of it, which `jostle run` and `jostle goal` share.
void add_goal_options(CLI::App& app, GoalArguments& arguments, RunOptions& options);

/// Reads the files that the arguments name, and fills in what they decide.
/// Errors   kInvalidArgument, kIo, naming the option or the file
Result<void> complete(const GoalArguments& arguments, RunOptions& options);

/// Returns the goal that these options describe, without its id.
jostle_msgs::msg::Goal make_goal(const RunOptions& options);

}  // namespace jostle::task
