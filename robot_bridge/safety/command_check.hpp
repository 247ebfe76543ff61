#pragma once
/// \file
/// What every command must pass before it moves anything.

#include <span>

#include "idl/types/result.hpp"

namespace jostle::robot_bridge {

/// An action that lasts longer is a mistake of its sender.
inline constexpr double kLongestAction = 60.0;  // s

/// Checks a control [nu] against the largest velocities of the robot's axes [nu], m/s and rad/s, held for
/// `duration` seconds.
/// Error kInvalidArgument naming the field, what it got and what it wanted.
Result<void> check_command(std::span<const double> u, std::span<const double> limits, double duration);

}  // namespace jostle::robot_bridge
