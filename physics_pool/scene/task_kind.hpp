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

  /// What a scene lacks for it: empty, or "got …, wanted …".
  std::string (*misfit)(const Scene& scene);

  /// c_g of the objective; `angle_weight` is its w_phi, m^2/rad^2.
  double (*cost)(const TaskGeometry& geometry, const State& x, double angle_weight);

  /// How far the task is from its end, m.
  double (*distance)(const TaskGeometry& geometry, const State& x);

  /// Whether the target is where it is to be. Whether it stands there is asked by `at_goal`.
  bool (*reached)(const TaskGeometry& geometry, const State& x);

  /// Why the task has failed at x, in a phrase; empty if it has not.
  std::string (*failure)(const TaskGeometry& geometry, const State& x);
};

/// All of them, in the order in which messages list them.
std::span<const TaskKind* const> task_kinds();

/// Null if there is none of that name.
const TaskKind* find_task_kind(std::string_view name);

}  // namespace jostle::physics_pool
