#pragma once
/// \file
/// Names of topics and types: ROS 2's, and what they are on the wire; and whose topic it is.

#include <optional>
#include <string>

#include "idl/types/result.hpp"

namespace jostle::wire {

/// "/robot/status" -> "rt/robot/status".
std::string wire_topic(const std::string& ros_topic);

/// The reverse; nothing for what is no ROS 2 topic.
std::optional<std::string> ros_topic(const std::string& wire_topic);

/// "jostle_msgs/msg/Goal" -> "jostle_msgs::msg::dds_::Goal_"; nothing for what is not of this form.
std::optional<std::string> wire_type(const std::string& ros_type);

/// The reverse; nothing for what is no ROS 2 message type.
std::optional<std::string> ros_type(const std::string& wire_type);

enum class Scope {
  kRobot,   ///< one robot's: in its namespace, if it has one
  kDomain,  ///< shared by all in the domain: the pool of workers
};

/// Reads a ROS 2 namespace, such as "left" or "/lab/left": words of letters, digits and single
/// underscores that begin with no digit. Gives it without the first slash; "" is none.
/// Error kInvalidArgument: says got and wanted; also for `pool` and `doctor`, which are everybody's.
Result<std::string> parse_namespace(const std::string& text);

/// "rt/joint_states" in "left": "rt/left/joint_states", as ROS 2 has /left/joint_states.
std::string in_namespace(const std::string& space, const std::string& topic);

}  // namespace jostle::wire
