#pragma once
/// \file
/// A UR5 and a Robotiq gripper as the planner's hand.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "robot_bridge/api/robot.hpp"
#include "robot_bridge/robotiq/client.hpp"
#include "robot_bridge/ur/planar_arm.hpp"

namespace jostle::robot_bridge::ur {

/// An ArmHand is the planner's planar gripper, made of an arm whose hand moves in a plane, and of a gripper: axes x, y,
/// rotation, opening. Time passes without us. Stamps are of the time of day at which a sample came.
///
/// An action that a stop request ends, or that fails, is answered once the arm stands still.
class ArmHand final : public Robot {
 public:
  /// `gripper` may be null: then the hand stays as it is, open. Both outlive it.
  ArmHand(PlanarArm& arm, robotiq::Client* gripper);

  /// Returns the largest speeds of the axes, m/s or rad/s.
  static std::vector<double> limits();

  Result<RobotReading> read(std::stop_token stop = {}) override;
  Result<void> start(std::span<const double> u, double duration, std::stop_token stop = {}) override;
  Result<bool> advance(std::stop_token stop = {}) override;

  /// Says what keeps it from moving; "" if nothing does.
  std::string trouble();
  /// How arm and gripper are, for those who look after them.
  struct Condition {
    PlanarArm::Report arm;
    std::string arm_trouble;  ///< "" if there is none
    std::optional<CalibrationError> calibration;
    std::optional<robotiq::Client::Report> gripper;  ///< nothing if there is none
  };
  Condition condition();
  /// Returns the arm's sample that the last reading was made of, which may be old: see ArmState::received.
  const ArmState& arm_state() const { return report_.state; }

 private:
  void refresh();
  void move_fingers();
  Error end(Error why);

  PlanarArm& arm_;
  robotiq::Client* const gripper_;
  PlanarArm::Report report_;
  double stamp_ = 0.0;  // s, of the report's sample
  robotiq::Client::Report fingers_;
  std::uint64_t motion_ = 0;  // the arm's number
  bool acts_ = false;
  double opening_ = 0.0;       // m, where it should be
  double opening_rate_ = 0.0;  // m/s
  std::chrono::steady_clock::time_point moved_at_{}, deadline_{};
};

}  // namespace jostle::robot_bridge::ur
