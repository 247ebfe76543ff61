#pragma once
/// \file
/// Names of topics and types: ROS 2's, and those on the wire; and whose topic it is.

#include <optional>
#include <string>

#include "idl/types/result.hpp"

namespace jostle::wire {

/// Turns "/robot/status" into "rt/robot/status".
std::string wire_topic(const std::string& ros_topic);

/// Does the reverse; nothing for what is no ROS 2 topic.
std::optional<std::string> ros_topic(const std::string& wire_topic);

/// Turns "jostle_msgs/msg/Goal" into "jostle_msgs::msg::dds_::Goal_"; nothing for what is not of this form.
std::optional<std::string> wire_type(const std::string& ros_type);

/// Does the reverse; nothing for what is no ROS 2 message type.
std::optional<std::string> ros_type(const std::string& wire_type);

enum class Scope {
  kRobot,   ///< one robot's: in its namespace, if it has one
  kDomain,  ///< shared by all in the domain: the pool of workers
};

/// Reads a ROS 2 namespace, such as "left" or "/lab/left": words of letters, digits and single
/// underscores that begin with no digit. Returns it without the first slash; "" is none.
/// Error kInvalidArgument: says got and wanted; also for `pool` and `doctor`, which are everybody's.
Result<std::string> parse_namespace(const std::string& text);

/// Puts a topic into a namespace: "rt/joint_states" in "left" is "rt/left/joint_states", as ROS 2 has
/// /left/joint_states; likewise requests (rq/) and replies (rr/) of services.
std::string in_namespace(const std::string& space, const std::string& topic);

}  // namespace jostle::wire
