#pragma once
/// \file
/// Scorer: an objective made ready for hot loops.

#include <optional>
#include <vector>

#include "physics_pool/objective/catalogue.hpp"
#include "physics_pool/objective/objective.hpp"

namespace jostle::physics_pool {

/// Looks the kinds up once and leaves out what weighs nothing. The objective, which is valid, outlives it.
class Scorer {
 public:
  explicit Scorer(const Objective& objective);

  /// Returns the sum of the running terms of one control step. Eq. 6.10 leaves x_N to the final cost alone; here
  /// every step counts. Allocates nothing.
  double running(const Step& step) const;

  /// Returns the sum of the final terms: what a rollout that ends at x pays there.
  double final(const TaskGeometry& geometry, const State& x) const;

  /// Whether the task's goal is reached: the target is where it is to be, has not dropped and does not lean.
  bool at_goal(const TaskGeometry& geometry, const State& x) const;

 private:
  struct Row {
    const TermKind* kind;
    double weight;
    const std::vector<double>* values;
  };
  bool stands(const TaskGeometry& geometry, const State& x) const;  // whether the target does: not dropped, not leaning

  friend std::optional<bool> object_in_hand(const TaskGeometry& geometry, const State& x);

  std::vector<Row> running_, final_;
  double drop_height_, topple_angle_;  // m, rad
};

/// Returns what the sensor of a simulated hand tells: whether the target is in its pre-grasp region, has not dropped
/// and does not lean; nothing where there is no hand.
std::optional<bool> object_in_hand(const TaskGeometry& geometry, const State& x);

/// Does the same as Scorer::at_goal, for an objective that is used once.
bool at_goal(const TaskGeometry& geometry, const State& x, const Objective& objective);

}  // namespace jostle::physics_pool
