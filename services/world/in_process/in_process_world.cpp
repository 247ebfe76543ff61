#include "services/world/in_process/in_process_world.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "physics_pool/objective/scorer.hpp"
#include "robot_bridge/safety/command_check.hpp"
#include "services/common/process/program.hpp"

namespace jostle::world {

std::vector<perception::ObjectReading> object_readings(const StateLayout& layout, const State& x) {
  std::vector<perception::ObjectReading> readings;
  for (const ObjectSlot& slot : layout.objects) {
    perception::ObjectReading reading{.name = slot.name};
    const auto q = x.q.begin() + slot.q;
    const auto v = x.v.begin() + slot.v;
    std::copy_n(q, 3, reading.position.begin());
    std::copy_n(q + 3, 4, reading.orientation.begin());
    std::copy_n(v, 3, reading.linear.begin());
    std::copy_n(v + 3, 3, reading.angular.begin());
    readings.push_back(std::move(reading));
  }
  return readings;
}

robot_bridge::RobotReading robot_reading(const physics_pool::ExecutionWorld& world) {
  const State& x = world.state();
  const physics_pool::TaskGeometry& geometry = world.world().geometry();
  const int joints = geometry.layout.robot_joints();
  return {.stamp = world.time(),
          .q = {x.q.begin(), x.q.begin() + joints},
          .v = {x.v.begin(), x.v.begin() + joints},
          .object_in_hand = physics_pool::object_in_hand(geometry, x)};
}

Result<robot_bridge::RobotReading> SimulatedRobot::read(std::stop_token stop) {
  if (stop.stop_requested()) return Error{Code::kCancelled, "robot: stopped on request"};
  return robot_reading(world_);
}

Result<void> SimulatedRobot::start(std::span<const double> u, double duration, std::stop_token stop) {
  if (steps_left_ > 0) return robot_bridge::action_at_work();
  if (auto ok = robot_bridge::check_command(u, physics_pool::axis_limits(world_.world().scene().robot.model), duration);
      !ok)
    return ok;
  if (stop.stop_requested()) return Error{Code::kCancelled, "robot: stopped before it moved"};
  world_.begin(u);
  began_ = std::chrono::steady_clock::now();
  steps_ = steps_left_ = std::lround(duration / world_.world().time_step());
  return {};
}

Result<bool> SimulatedRobot::advance(std::stop_token stop) {
  if (steps_left_ <= 0) return true;
  const long left = std::exchange(steps_left_, 0);
  if (stop.stop_requested()) return Error{Code::kCancelled, "robot: stopped in mid-action"};
  if (auto ok = world_.step(); !ok) return ok.error();
  steps_left_ = left - 1;
  if (rate_ > 0) {
    const auto done = static_cast<double>(steps_ - steps_left_);
    const std::chrono::duration<double> since(done * world_.world().time_step() / rate_);
    // A stop is seen by the next step.
    (void)common::pause_until(began_ + std::chrono::duration_cast<std::chrono::nanoseconds>(since), std::move(stop));
  }
  return steps_left_ == 0;
}

Result<std::vector<perception::ObjectReading>> SimulatedObjects::read() {
  using physics_pool::Measurement;
  const Measurement measurement = world_.time() > 0 ? Measurement::kFeedback : Measurement::kInitial;
  const State seen = physics_pool::observed_state(world_.world().scene(), belief_, world_.state(), measurement);
  return object_readings(world_.world().geometry().layout, seen);
}

}  // namespace jostle::world
