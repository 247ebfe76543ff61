#pragma once
/// \file
/// A real arm and gripper as a body that obeys over DDS.

#include <chrono>
#include <string>
#include <vector>

#include "robot_bridge/ur/arm_hand.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/world/link/robot_out.hpp"
#include "services/world/link/robot_server.hpp"

namespace jostle::world {

/// An ArmBody is an arm's hand on DDS, with the arm itself beside it, its joints as often as the controller tells them
/// (up to 500 times a second), and once a second how arm and gripper are. Stamps are of the time of day.
class ArmBody final : public Body {
 public:
  /// `hand` is asked what only it knows; commands and readings pass through `robot`, which is `hand` or stands before
  /// it. `mounting`: where the arm stands. `patience`: with a commander that is silent. `host`: the controller's, for
  /// diagnostics. Both robots outlive it.
  ArmBody(const wire::Participant& participant, robot_bridge::ur::ArmHand& hand, robot_bridge::Robot& robot,
          const robot_bridge::planar::Mounting& mounting, std::chrono::milliseconds patience, std::string host);

  std::vector<double> limits() const override { return robot_bridge::ur::ArmHand::limits(); }
  Result<void> begin(std::span<const double> u, double duration) override;
  bool is_over() const override { return over_; }
  Result<void> advance() override;
  void halt() override;
  Result<bool> rest() override;
  std::optional<std::chrono::milliseconds> patience() const override { return patience_; }
  std::chrono::milliseconds period() const override { return std::chrono::milliseconds(20); }
  robot_bridge::RobotReading reading() override;
  void publish() override;

 private:
  void tell_joints();

  robot_bridge::ur::ArmHand& hand_;
  robot_bridge::Robot& robot_;
  const std::chrono::milliseconds patience_;
  const std::string host_;
  bool over_ = true;
  std::string said_;                              // the trouble that was told last
  robot_bridge::RobotReading reading_;            // the last good one
  std::chrono::steady_clock::time_point told_{};  // when the sample came whose joints were published last
  std::chrono::steady_clock::time_point next_diagnostics_{};
  RobotTopics arm_;
  wire::Writer<diagnostic_msgs::msg::DiagnosticArray> diagnostics_;
};

}  // namespace jostle::world
