#pragma once
/// \file
/// A real arm and gripper as a body that obeys over DDS.

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "robot_bridge/robotiq/client.hpp"
#include "robot_bridge/ur/planar_arm.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"
#include "services/world/link/robot_server.hpp"

namespace jostle::world {

/// An ArmBody is the planner's planar gripper, made of a UR5 and a Robotiq gripper: axes x, y, rotation, opening.
/// Stamps are of the time of day.
class ArmBody final : public Body {
 public:
  /// `gripper` may be null: then the hand stays as it is, open. `patience`: with a commander that is silent.
  ArmBody(const wire::Participant& participant, robot_bridge::ur::PlanarArm& arm,
          robot_bridge::robotiq::Client* gripper, std::chrono::milliseconds patience);

  std::vector<double> limits() const override;
  Result<void> begin(std::span<const double> u, double duration) override;
  bool is_over() const override { return over_; }
  Result<void> advance() override;
  void halt() override;
  Result<bool> rest() override;
  std::optional<std::chrono::milliseconds> patience() const override { return patience_; }
  std::chrono::milliseconds period() const override { return std::chrono::milliseconds(20); }
  double time() const override;
  robot_bridge::RobotReading reading() const override;
  void publish() override;

  /// Says what keeps it from moving; "" if nothing does.
  std::string trouble();

 private:
  void refresh();

  robot_bridge::ur::PlanarArm& arm_;
  robot_bridge::robotiq::Client* const gripper_;
  const std::chrono::milliseconds patience_;
  robot_bridge::ur::PlanarArm::Report report_;
  robot_bridge::robotiq::Client::Report hand_;
  std::uint64_t motion_ = 0;  // the arm's number
  bool over_ = true;
  std::string said_;           // the trouble that was told last
  double opening_ = 0.0;       // m, where it should be
  double opening_rate_ = 0.0;  // m/s
  std::chrono::steady_clock::time_point moved_at_{}, deadline_{};
  wire::Writer<sensor_msgs::msg::JointState> joints_;
};

}  // namespace jostle::world
