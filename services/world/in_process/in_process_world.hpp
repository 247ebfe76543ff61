#pragma once
/// \file
/// An execution world in this process behind the two ports: for studies, where
/// the wire would only add noise to the clock.

#include <chrono>

#include "perception/api/object_source.hpp"
#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/scene/scene.hpp"
#include "physics_pool/uncertainty/belief.hpp"
#include "robot_bridge/api/robot.hpp"

namespace jostle::world {

/// Makes object readings from a full state.
std::vector<perception::ObjectReading> object_readings(const StateLayout& layout, const State& x);

/// Returns what the robot of an execution world says of itself.
robot_bridge::RobotReading robot_reading(const physics_pool::ExecutionWorld& world);

/// Moves an execution world by commands. Time stands still between actions, as
/// in the thesis's simulation experiments.
class SimulatedRobot final : public robot_bridge::Robot {
 public:
  /// `rate`: world seconds per second while acting, at most; 0: as fast as the world can be simulated.
  explicit SimulatedRobot(physics_pool::ExecutionWorld& world, double rate = 0.0) : world_(world), rate_(rate) {}

  Result<robot_bridge::RobotReading> read(std::stop_token stop = {}) override;
  Result<void> start(std::span<const double> u, double duration, std::stop_token stop = {}) override;
  Result<bool> advance(std::stop_token stop = {}) override;

 private:
  physics_pool::ExecutionWorld& world_;
  const double rate_;
  std::chrono::steady_clock::time_point began_;  // the action at work
  long steps_ = 0, steps_left_ = 0;              // engine steps of the action at work
};

/// Sees the objects of an execution world as observed_state does: the initial
/// measurement until the world has moved.
class SimulatedObjects final : public perception::ObjectSource {
 public:
  /// `belief`: the planning scene.
  SimulatedObjects(const physics_pool::ExecutionWorld& world, physics_pool::Scene belief)
      : world_(world), belief_(std::move(belief)) {}

  Result<std::vector<perception::ObjectReading>> read() override;

 private:
  const physics_pool::ExecutionWorld& world_;
  physics_pool::Scene belief_;
};

}  // namespace jostle::world
