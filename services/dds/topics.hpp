#pragma once
/// \file
/// Every topic of the system: name, type, promise.

#include <fmt/format.h>

#include "services/dds/topic.hpp"

namespace jostle::topics {

namespace msg = jostle_msgs::msg;
using dds::Topic;

/// What the robot and the world say of themselves; ROS 2 tools read these.
inline const Topic<sensor_msgs::msg::JointState> kJointStates{"rt/joint_states", dds::kState};
inline const Topic<tf2_msgs::msg::TFMessage> kTransforms{"rt/tf", dds::kState};
inline const Topic<geometry_msgs::msg::PoseArray> kObjectPoses{"rt/objects/poses", dds::kState};
inline const Topic<msg::ObjectStates> kObjectStates{"rt/objects/states", dds::kState};

inline const Topic<msg::VelocityCommand> kRobotCommand{"rt/robot/command", dds::kTask};
inline const Topic<msg::RobotStatus> kRobotStatus{"rt/robot/status", dds::kState};

inline const Topic<msg::Goal> kTaskGoal{"rt/task/goal", dds::kTask};
inline const Topic<msg::Cancel> kTaskCancel{"rt/task/cancel", dds::kTask};
inline const Topic<msg::Feedback> kTaskFeedback{"rt/task/feedback", dds::kState};
inline const Topic<msg::GoalResult> kTaskResult{"rt/task/result", dds::kAnswer};

/// The pool is everybody's, whatever robot they plan for.
inline const Topic<msg::WorkerHeartbeat> kPoolWorker{"rt/pool/worker", dds::kState, dds::Scope::kDomain};
inline const Topic<msg::WorldDescription> kPoolWorld{"rt/pool/world", dds::kCatalogue, dds::Scope::kDomain};
inline const Topic<msg::BatchControl> kPoolControl{"rt/pool/control", dds::kTask, dds::Scope::kDomain};
inline const Topic<msg::TaskResult> kPoolResult{"rt/pool/result", dds::kTask, dds::Scope::kDomain};

/// Each worker reads its own: one sample per task on a shared topic would reach
/// all of them (32 workers: 22.5 ms against 2.7 ms).
inline Topic<msg::Task> pool_task(std::uint64_t worker) {
  return {fmt::format("rt/pool/task/w{:016x}", worker), dds::kTask, dds::Scope::kDomain};
}

}  // namespace jostle::topics
