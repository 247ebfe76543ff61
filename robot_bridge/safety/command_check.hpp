#pragma once
/// \file
/// What every command must pass before it moves anything.

#include <span>

#include "idl/types/result.hpp"

namespace jostle::robot_bridge {

/// Faster or longer is a mistake of the sender, whatever the robot.
inline constexpr double kFastest = 2.0;         // m/s, rad/s
inline constexpr double kLongestAction = 60.0;  // s

/// Checks a control of `axes` velocities, m/s and rad/s in the order of ControlAxis,
/// held for `duration` seconds.
/// Error kInvalidArgument naming the field, what it got and what it wanted.
Result<void> check_command(std::span<const double> u, int axes, double duration);

}  // namespace jostle::robot_bridge
