#pragma once
/// \file
/// How an arm is, for ROS 2's tools.

#include <string>

#include "idl/msg/diagnostics.h"
#include "robot_bridge/ur/arm_hand.hpp"

namespace jostle::world {

/// Returns a status of the arm and, where there is one, of the gripper: STALE while nothing is heard of it, ERROR while
/// it is not ready, and why, else OK. `host`: the controller's; `stamp`: s, of the time of day.
diagnostic_msgs::msg::DiagnosticArray diagnostics_of(const robot_bridge::ur::ArmHand::Condition& condition,
                                                     const std::string& host, double stamp);

}  // namespace jostle::world
