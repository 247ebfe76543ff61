#pragma once
/// \file
/// The catalogue of controllers: the only list of their names.

#include <span>
#include <string>
#include <string_view>

#include "planners/control/controller.hpp"
#include "planners/mpc/mpc.hpp"

namespace jostle::planners {

/// What controllers are told; each takes its part.
struct ControllerOptions {
  ControlOptions control;
  MpcOptions mpc;

  void set_plan_only(bool plan_only) { control.plan_only = mpc.plan_only = plan_only; }
};

/// One controller.
struct ControllerKind {
  const char* name;        ///< as users type it
  const char* purpose;     ///< one phrase with its source
  const char* parameters;  ///< file of what `jostle run` gives it where the user names none

  /// Whether it can do a scene's task with the scene's robot.
  bool (*fits)(const physics_pool::Scene& scene);

  /// Runs one task to its end: see run_controller and run_mpc.
  Result<Outcome> (*run)(const ControlSetup& setup, const ControllerOptions& options, const OnEvent& on_event,
                         std::stop_token stop);
};

/// All of them. The first that fits a scene is what the scene gets where nobody names one.
std::span<const ControllerKind* const> controllers();

/// Names and purposes on one line, for help texts.
std::string controller_help();

/// By name, or the first that fits the scene where the name is empty.
/// Error kInvalidArgument: "controller: got 'mpc' for a task to grasp, wanted or, nr".
Result<const ControllerKind*> find_controller(std::string_view name, const physics_pool::Scene& scene);

/// Adds one at the end, for programs that bring controllers of their own: before anything runs, from one thread.
/// `kind` outlives its users.
void add_controller(const ControllerKind& kind);

}  // namespace jostle::planners
