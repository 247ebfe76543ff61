#pragma once
/// \file
/// The robot and its objects as messages. Whatever comes from the wire is
/// checked here before anyone calculates with it.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "idl/msg/robot.h"
#include "idl/msg/task.h"
#include "idl/types/hash.hpp"
#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "perception/api/object_source.hpp"
#include "robot_bridge/api/robot.hpp"

namespace jostle::world {

inline constexpr const char* kWorldFrame = "world";

/// `time`: seconds since the simulated world's start, >= 0.
std_msgs::msg::Header make_header(double time, const std::string& frame = kWorldFrame);
double seconds(const std_msgs::msg::Header& header);

jostle_msgs::msg::ObjectStates to_message(const std::vector<perception::ObjectReading>& objects, double time);
/// Error kInvalidArgument naming the field that is not finite or no rotation.
Result<std::vector<perception::ObjectReading>> from_message(const jostle_msgs::msg::ObjectStates& message);

/// These are standard forms of the same, for ROS 2 tools.
sensor_msgs::msg::JointState joint_state_message(const StateLayout& layout, const State& x, double time);
geometry_msgs::msg::PoseArray pose_array_message(const jostle_msgs::msg::ObjectStates& objects);
tf2_msgs::msg::TFMessage transform_message(const jostle_msgs::msg::ObjectStates& objects);

/// Compares what a world says of itself (RobotStatus.scene; empty: a real one, or not heard yet) with scene_hash() of
/// the scene that plans are made for. Error kUnknownWorld: it is another one; with both hashes and the remedy.
Result<void> check_scene(const std::string& simulated, const Hash& wanted);

/// Makes the message that ends the command at work, and those of its commander that wait (robot.idl).
jostle_msgs::msg::VelocityCommand stop_message(std::uint64_t epoch, std::uint64_t sequence_number);
bool is_stop(const jostle_msgs::msg::VelocityCommand& command);

/// Converts to and from `in_hand` of a status or an observation, one of RobotStatus_Constants. A number that
/// is none of them says nothing about the hand.
std::uint8_t in_hand_message(std::optional<bool> object_in_hand);
std::optional<bool> in_hand_from(std::uint8_t in_hand);

/// Error kInvalidArgument naming the field.
Result<robot_bridge::RobotReading> from_message(const jostle_msgs::msg::RobotStatus& message);

/// Puts an error into a status, and takes it out again: nothing while all is well. A deadline or a cancellation of the
/// robot's is none of its commander's, and arrives as kUnavailable; a code that is none as kInternal.
void put_error(const std::optional<Error>& error, jostle_msgs::msg::RobotStatus& message);
std::optional<Error> error_of(const jostle_msgs::msg::RobotStatus& message);

/// What a controller sees at a time.
struct Seen {
  robot_bridge::RobotReading robot;
  std::vector<perception::ObjectReading> objects;
};

/// Makes an observation; its goal, number and command are left to the caller.
jostle_msgs::msg::Observation to_message(const Seen& seen, double time);
/// Error kInvalidArgument naming the field.
Result<Seen> from_message(const jostle_msgs::msg::Observation& message);

}  // namespace jostle::world
