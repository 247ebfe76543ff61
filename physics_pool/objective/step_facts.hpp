#pragma once
/// \file
/// Facts of a control step.

namespace jostle::physics_pool {

/// What happened during a control step and cannot be told from its states.
struct StepFacts {
  bool robot_hit_fixture = false;  ///< any link touched a fixture in any engine step; c_c of Eq. 4.36

  bool operator==(const StepFacts&) const = default;
};

}  // namespace jostle::physics_pool
