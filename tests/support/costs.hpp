#pragma once
/// \file
/// Costs of one step or state, each with a scorer of its own.

#include <string>
#include <utility>
#include <vector>

#include "physics_pool/objective/scorer.hpp"
#include "physics_pool/objective/terms.hpp"

namespace jostle::tests {

using physics_pool::Objective;
using physics_pool::TaskGeometry;

/// The standard objective with some of its numbers changed, by the keys of parameter files: "edge", "edge_rate".
inline Objective objective_with(const std::vector<std::pair<std::string, double>>& changes) {
  Objective objective = Objective::standard();
  for (const auto& [key, value] : changes) {
    for (const physics_pool::TermKind* kind : physics_pool::term_catalogue()) {
      if (key == kind->name) objective[kind->name].weight = value;
      for (const auto& parameter : kind->parameters) {
        if (key == std::string(kind->name) + "_" + parameter.name) objective.value(kind->name, parameter.name) = value;
      }
    }
    if (key == "success_cost") objective.success_cost = value;
  }
  return objective;
}

inline double running_cost(const TaskGeometry& geometry, const Objective& objective, std::span<const double> u_before,
                           std::span<const double> u, const State& x0, const State& x1) {
  return physics_pool::Scorer(objective).running(
      {.geometry = geometry, .u_before = u_before, .u = u, .x0 = x0, .x1 = x1});
}

inline double final_cost(const TaskGeometry& geometry, const Objective& objective, const State& x) {
  return physics_pool::Scorer(objective).final(geometry, x);
}

inline double goal_cost(const TaskGeometry& geometry, const State& x, double angle_weight) {
  return geometry.kind->cost(geometry, x, angle_weight);
}

inline double goal_distance(const TaskGeometry& geometry, const State& x) {
  return geometry.kind->distance(geometry, x);
}

inline double edge_cost(const TaskGeometry& geometry, const State& x0, const State& x1, const Objective& objective) {
  return physics_pool::edge_cost(geometry, x0, x1,
                                 {.rate = objective.value("edge", "rate"),
                                  .exponent_max = objective.value("edge", "exponent_max"),
                                  .margin = objective.value("edge", "margin")});
}

inline double obstacle_cost(const TaskGeometry& geometry, const State& x, const Objective& objective) {
  return physics_pool::obstacle_cost(geometry, x,
                                     {.target = objective.value("obstacle", "target"),
                                      .pusher = objective.value("obstacle", "pusher"),
                                      .nearest = objective.value("obstacle", "nearest")});
}

}  // namespace jostle::tests
