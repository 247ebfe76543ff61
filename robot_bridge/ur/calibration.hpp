#pragma once
/// \file
/// An arm as it was measured at the factory, beside the arm as drawn: its controller tells the former, closed-form
/// kinematics are of the latter.

#include <cstdint>
#include <string>

#include "robot_bridge/net/tcp_client.hpp"
#include "robot_bridge/planar/arm_in_plane.hpp"
#include "robot_bridge/ur/kinematics.hpp"

namespace jostle::robot_bridge::ur {

/// Reads it from the primary or secondary interface, whose first states have it.
/// Error kDeadline  the controller tells none, or one that it does not hold for valid
///       kUnavailable, kInvalidArgument  it is gone, or its packets have no meaning
Result<Dh> read_calibration(const std::string& host, std::uint16_t port, net::Clock::time_point deadline);

/// How far the hand is from where kinematics as drawn take it to be, at most.
struct CalibrationError {
  double distance = 0.0;  ///< m
  double angle = 0.0;     ///< rad
};

/// Returns that over hands that are held in their plane before an arm that is mounted so, every 10 cm and 0.5 rad, as
/// far as it reaches.
CalibrationError compare(const Dh& calibrated, const planar::Mounting& mounting);

/// The farthest off that a hand in its plane may be. The wrist clears the surface by 8.7 mm at least (measured in the
/// runs of services/world/bridge/arm_guard.cpp), and a hand as tilted is out of its plane.
inline constexpr double kMostCalibrationDistance = 0.008;                       // m
inline constexpr double kMostCalibrationAngle = planar::ArmInPlane::kMostTilt;  // rad

/// Error kInvalidArgument  the arm is farther off than that; says how far
Result<CalibrationError> check_calibration(const Dh& calibrated, const planar::Mounting& mounting);

}  // namespace jostle::robot_bridge::ur
