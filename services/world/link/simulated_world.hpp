#pragma once
/// \file
/// The execution world as a body that obeys over DDS.

#include <chrono>
#include <vector>

#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/scene/scene.hpp"
#include "services/world/in_process/in_process_world.hpp"
#include "services/world/link/objects_out.hpp"
#include "services/world/link/robot_out.hpp"
#include "services/world/link/robot_server.hpp"

namespace jostle::world {

struct SimulatedWorldOptions {
  physics_pool::VelocityNoise noise;
  /// The planner's scene. The objects' first measurement agrees with it, and all later ones keep its heights.
  physics_pool::Scene belief;
  /// World seconds per second while an action runs; 0 is as fast as possible.
  double rate = 0.0;
  /// Let the world go on between actions (the robot brakes and holds) instead
  /// of standing still, as in the thesis's simulation experiments.
  bool free_running = false;
};

/// A SimulatedWorld publishes its robot and its clock, and tells how objects are seen: all of them measurements, not
/// truth.
class SimulatedWorld final : public Body {
 public:
  /// `objects`: where it tells how objects are seen; outlives it.
  SimulatedWorld(const wire::Participant& participant, const physics_pool::WorldPtr& world,
                 const SimulatedWorldOptions& options, ObjectsOut& objects);

  std::string scene() const override { return to_string(world_.world().hash()); }
  std::vector<double> limits() const override;
  Result<void> begin(std::span<const double> u, double duration) override;
  bool is_over() const override { return steps_left_ <= 0; }
  Result<void> advance() override;
  void halt() override { steps_left_ = 0; }
  Result<bool> rest() override;
  robot_bridge::RobotReading reading() override { return robot_reading(world_); }
  void publish() override;

 private:
  SimulatedWorldOptions options_;
  physics_pool::ExecutionWorld world_;
  std::vector<double> still_;                    // the control that moves nothing
  long steps_ = 0, steps_left_ = 0;              // engine steps of the motion
  std::chrono::steady_clock::time_point began_;  // the motion
  bool moved_ = false;                           // a motion was begun

  ObjectsOut& objects_;
  RobotTopics robot_;
  wire::Writer<rosgraph_msgs::msg::Clock> clock_;
};

}  // namespace jostle::world
