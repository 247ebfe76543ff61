#pragma once
/// \file
/// One control step as terms see it.

#include <span>

#include "idl/types/state.hpp"
#include "physics_pool/objective/step_facts.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::physics_pool {

struct Step {
  const TaskGeometry& geometry;
  std::span<const double> u_before, u;  ///< [nu]
  const State& x0;
  const State& x1;
  StepFacts facts;
};

}  // namespace jostle::physics_pool
