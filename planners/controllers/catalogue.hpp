#pragma once
/// \file
/// The catalogue of controllers: the only list of their names.

#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "planners/adaptive/adaptive.hpp"
#include "planners/control/controller.hpp"
#include "planners/mpc/mpc.hpp"
#include "planners/robustness/robust_control.hpp"

namespace jostle::planners {

/// The options of all controllers; each controller takes its part.
struct ControllerOptions {
  ControlOptions control;
  MpcOptions mpc;
  AdaptiveOptions adaptive;
  RobustControlOptions robust;

  void set_plan_only(bool plan_only) {
    control.plan_only = mpc.plan_only = adaptive.plan_only = robust.plan_only = plan_only;
  }
};

/// One controller.
struct ControllerKind {
  const char* name;        ///< as users type it
  const char* purpose;     ///< one phrase with its source
  const char* parameters;  ///< the parameter file that `jostle run` gives it where the user names none
  /// What another file changes of them for robots that do not move in the plane; null: nothing.
  const char* arm_parameters = nullptr;

  /// Whether it can do a scene's task with the scene's robot.
  bool (*fits)(const physics_pool::Scene& scene);

  /// Runs one task to its end: see run_controller and run_mpc.
  Result<Outcome> (*run)(const ControlSetup& setup, const ControllerOptions& options, const OnEvent& on_event,
                         std::stop_token stop);

  /// Makes the planner that it runs with, which keeps references to pool, scene and geometry; null: a Pbsto.
  std::unique_ptr<Planner> (*planner)(physics_pool::Pool& pool, const physics_pool::Scene& scene,
                                      const physics_pool::TaskGeometry& geometry, const PbstoOptions& optimizer,
                                      const ControllerOptions& options, OnProgress on_progress) = nullptr;

  /// Whether that planner improves Problem::initial; otherwise it makes sequences of its own.
  bool improves_initial = false;
};

/// Makes the planner of a controller. Pool, scene and geometry outlive it.
/// `scene`: the planning world.
std::unique_ptr<Planner> make_planner(const ControllerKind& kind, physics_pool::Pool& pool,
                                      const physics_pool::Scene& scene, const physics_pool::TaskGeometry& geometry,
                                      const PbstoOptions& optimizer, const ControllerOptions& options,
                                      OnProgress on_progress = {});

/// Returns all controllers. Where nobody names one, a scene gets the first that fits it.
std::span<const ControllerKind* const> controllers();

/// Names and purposes on one line, for help texts.
std::string controller_help();
std::vector<std::string> controller_names();

/// Finds a controller by its name, or the first that fits the scene where the name is empty.
/// Error kInvalidArgument: "controller: got 'mpc' for a task to grasp with the robot 'planar_gripper', wanted or, nr".
Result<const ControllerKind*> find_controller(std::string_view name, const physics_pool::Scene& scene);

/// Adds a controller at the end, for programs that bring their own. Call it from one thread, before anything runs.
/// `kind` outlives its users.
void add_controller(const ControllerKind& kind);

}  // namespace jostle::planners
