#pragma once
/// \file
/// The execution world as a simulated controller's plant.

#include <cmath>

#include "physics_pool/local/execution_world.hpp"
#include "robot_bridge/ur_sim/plant.hpp"

namespace jostle::world {

/// A WorldPlant is an execution world whose robot is ur5_2f85. One thread.
class WorldPlant final : public robot_bridge::ur_sim::Plant {
 public:
  explicit WorldPlant(physics_pool::WorldPtr world) : world_(std::move(world)) {}

  Result<void> step(const robot_bridge::ur_sim::Joints& speeds, double opening_rate, double duration) override;
  robot_bridge::ur_sim::Joints positions() const override;
  robot_bridge::ur_sim::Joints velocities() const override;
  double opening() const override { return world_.state().q[kArm] + world_.state().q[kArm + 1]; }
  double opening_velocity() const override { return world_.state().v[kArm] + world_.state().v[kArm + 1]; }

  const physics_pool::ExecutionWorld& world() const { return world_; }

 private:
  static constexpr std::size_t kArm = 6;  // joints; the fingers follow

  physics_pool::ExecutionWorld world_;
};

}  // namespace jostle::world
