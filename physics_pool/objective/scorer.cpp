#include "physics_pool/objective/scorer.hpp"

#include <cmath>

namespace jostle::physics_pool {

Scorer::Scorer(const Objective& objective)
    : drop_height_(objective.value("drop", "height")), topple_angle_(objective.value("topple", "angle")) {
  for (const TermKind* kind : term_catalogue()) {
    const Term* term = objective.find(kind->name);
    if (!term || term->weight == 0 || (kind->takes_state && term->values.empty())) continue;
    const Row row{kind, term->weight, &term->values};
    if (kind->running) running_.push_back(row);
    if (kind->final) final_.push_back(row);
  }
}

double Scorer::running(const Step& step) const {
  double sum = 0.0;
  for (const Row& row : running_) sum += row.weight * row.kind->running(step, *row.values);
  return sum;
}

double Scorer::final(const TaskGeometry& geometry, const State& x) const {
  double sum = 0.0;
  for (const Row& row : final_) sum += row.weight * row.kind->final(geometry, x, *row.values);
  return sum;
}

bool Scorer::at_goal(const TaskGeometry& geometry, const State& x) const {
  return stands(geometry, x) && geometry.kind->reached(geometry, x);
}

bool Scorer::stands(const TaskGeometry& geometry, const State& x) const {
  const auto target = static_cast<std::size_t>(geometry.layout.target);
  const ObjectView seen = geometry.view(x).target();
  if (seen.position()[2] < geometry.rest_heights[target] - drop_height_) return false;
  return seen.uprightness() >= std::cos(topple_angle_);
}

std::optional<bool> object_in_hand(const TaskGeometry& geometry, const State& x) {
  if (!geometry.robot.hand) return {};
  const Objective defaults;
  return Scorer(defaults).stands(geometry, x) && in_pre_grasp_region(geometry, x);
}

bool at_goal(const TaskGeometry& geometry, const State& x, const Objective& objective) {
  return Scorer(objective).at_goal(geometry, x);
}

}  // namespace jostle::physics_pool
