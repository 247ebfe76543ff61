#include "physics_pool/local/execution_world.hpp"

#include <fmt/format.h>

#include <utility>

#include "physics_pool/local/engine.hpp"

namespace jostle::physics_pool {

ExecutionWorld::ExecutionWorld(WorldPtr world, const VelocityNoise& noise)
    : simulator_(std::move(world)), noise_(noise), state_(initial_state(simulator_.world().scene())) {
  begin(std::vector<double>(static_cast<std::size_t>(simulator_.world().geometry().layout.nu), 0.0));
}

void ExecutionWorld::begin(std::span<const double> u) {
  u_.assign(u.begin(), u.end());
  simulator_.begin(state_, u);
}

Result<void> ExecutionWorld::step() {
  std::string problem;
  try {
    simulator_.step();
    problem = simulator_.divergence();
  } catch (const EngineError& error) {
    problem = error.what();
  }
  if (!problem.empty()) {
    return Error{Code::kInternal, fmt::format("world: diverged after {} s: {}", time(), problem)};
  }
  if (!noise_.is_off()) simulator_.disturb(noise_, kStream, steps_, u_);
  ++steps_;
  simulator_.read(state_);
  return {};
}

}  // namespace jostle::physics_pool
