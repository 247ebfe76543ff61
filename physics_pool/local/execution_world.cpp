#include "physics_pool/local/execution_world.hpp"

#include <fmt/format.h>

#include "physics_pool/local/engine.hpp"
#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::physics_pool {
namespace {

constexpr std::uint32_t kVelocityNoiseStream = 0xe3e3;

}  // namespace

ExecutionWorld::ExecutionWorld(WorldPtr world, double velocity_sigma, std::uint64_t seed)
    : simulator_(world), sigma_(velocity_sigma), seed_(seed), state_(initial_state(world->scene())) {
  begin(std::vector<double>(static_cast<std::size_t>(world->geometry().layout.nu), 0.0));
}

void ExecutionWorld::begin(std::span<const double> u) { simulator_.begin(state_, u); }

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
  if (sigma_ > 0) {
    for (int dof = 0; dof < world().geometry().layout.nv; ++dof) {
      const DrawIndex index{.stream = kVelocityNoiseStream,
                            .sample = static_cast<std::uint32_t>(steps_ >> 32),
                            .step = static_cast<std::uint32_t>(steps_),
                            .axis = static_cast<std::uint32_t>(dof)};
      simulator_.add_velocity(dof, sigma_ * standard_normal(seed_, index));
    }
  }
  ++steps_;
  simulator_.read(state_);
  return {};
}

}  // namespace jostle::physics_pool
