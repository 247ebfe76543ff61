#pragma once
/// \file
/// Names of topics and types: ROS 2's, and what they are on the wire.

#include <optional>
#include <string>

namespace jostle::dds {

/// "/robot/status" -> "rt/robot/status".
std::string wire_topic(const std::string& ros_topic);

/// The reverse; nothing for what is no ROS 2 topic.
std::optional<std::string> ros_topic(const std::string& wire_topic);

/// "jostle_msgs/msg/Goal" -> "jostle_msgs::msg::dds_::Goal_"; nothing for what is not of this form.
std::optional<std::string> wire_type(const std::string& ros_type);

/// The reverse; nothing for what is no ROS 2 message type.
std::optional<std::string> ros_type(const std::string& wire_type);

}  // namespace jostle::dds
