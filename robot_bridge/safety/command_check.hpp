#pragma once
/// \file
/// What every command must pass before it moves anything.

#include <span>

#include "idl/types/result.hpp"

namespace jostle::robot_bridge {

/// The limit of a sender that does not know the robot's: what is faster is a mistake whatever the robot.
inline constexpr double kAnySpeed = 10.0;       // m/s, rad/s
/// Longer is a mistake of the sender.
inline constexpr double kLongestAction = 60.0;  // s

/// Checks a control [nu] against the largest velocities of the robot's axes [nu], m/s and rad/s, held for
/// `duration` seconds.
/// Error kInvalidArgument naming the field, what it got and what it wanted.
Result<void> check_command(std::span<const double> u, std::span<const double> limits, double duration);

}  // namespace jostle::robot_bridge
