#pragma once
/// \file
/// What can be said of a moment of a world beside its state.

#include <span>
#include <vector>

#include "physics_pool/local/handles.hpp"
#include "physics_pool/local/world.hpp"

namespace jostle::physics_pool {

struct Inspection {
  double deepest = 0.0;     ///< m, how far any two bodies are in each other, but for the robot in fixtures; 0 or more
  double in_fixture = 0.0;  ///< m, how far the robot is in a fixture
  double energy = 0.0;      ///< J, kinetic and potential, of robot and objects; its zero is where the engine puts it
  /// [joints] N or N m, that the drives make, with what balances a robot that carries itself.
  std::vector<double> drive;
};

/// Looks at states without moving them. One thread.
class Inspector {
 public:
  explicit Inspector(WorldPtr world);

  /// `u`: the control at work, [nu]. Error kInternal: the engine refused the state.
  Result<Inspection> look(const State& x, std::span<const double> u);

 private:
  WorldPtr world_;
  DataPtr data_;
};

}  // namespace jostle::physics_pool
