#pragma once
/// \file
/// Kinds of tasks: one row of a table each. physics_pool/task has the rows.

#include <span>
#include <string>
#include <string_view>

#include "idl/types/result.hpp"
#include "idl/types/state.hpp"

namespace jostle::physics_pool {

struct Scene;
struct TaskGeometry;

/// What a task means. All functions are pure; distances in m.
struct TaskKind {
  const char* name;      ///< as scenes spell it
  const char* purpose;   ///< one phrase, for lists
  const char* achieved;  ///< what has come about at its end, "target grasped"
  bool has_goal;         ///< scenes give it a goal region, and may give an obstacle

  /// Says what a scene lacks for it, "got …, wanted …"; empty if nothing.
  std::string (*misfit)(const Scene& scene);

  /// Returns c_g, the measure of the objective's term `goal`; `angle_weight` is that term's w_phi, m^2/rad^2.
  double (*cost)(const TaskGeometry& geometry, const State& x, double angle_weight);

  /// How far the task is from its end, m.
  double (*distance)(const TaskGeometry& geometry, const State& x);

  /// The largest `distance` at which the task can be done, m; null where nothing is foretold of how it comes about,
  /// because a target that was set going needs nobody to get there (objective/bound.hpp).
  double (*distance_at_end)(const TaskGeometry& geometry);

  /// Whether the target is where it is to be. It need not stand there: that is for `at_goal` to check.
  bool (*reached)(const TaskGeometry& geometry, const State& x);

  /// Why the task has failed at x, in a phrase; empty if it has not.
  std::string (*failure)(const TaskGeometry& geometry, const State& x);
};

/// Returns all kinds of tasks, in the order in which messages list them.
std::span<const TaskKind* const> task_kinds();

/// Finds a kind of task by its name; null if there is none.
const TaskKind* find_task_kind(std::string_view name);

}  // namespace jostle::physics_pool
