#pragma once
/// \file
/// Every topic of the system: name, type, promise.

#include <fmt/format.h>

#include <tuple>

#include "services/wire/dds/topic.hpp"

namespace jostle::wire::topics {

namespace msg = jostle_msgs::msg;

/// These are what the robot and the world say of themselves; ROS 2 tools read them.
inline const Topic<sensor_msgs::msg::JointState> kJointStates{"rt/joint_states", kState};
inline const Topic<tf2_msgs::msg::TFMessage> kTransforms{"rt/tf", kState};
inline const Topic<geometry_msgs::msg::PoseArray> kObjectPoses{"rt/objects/poses", kState};
inline const Topic<msg::ObjectStates> kObjectStates{"rt/objects/states", kState};

/// How a robot's parts are; a bridge says it once a second.
inline const Topic<diagnostic_msgs::msg::DiagnosticArray> kDiagnostics{"rt/diagnostics", kState};

inline const Topic<msg::VelocityCommand> kRobotCommand{"rt/robot/command", kCommand};
inline const Topic<msg::RobotStatus> kRobotStatus{"rt/robot/status", kState};

inline const Topic<msg::Goal> kTaskGoal{"rt/task/goal", kCommand};
inline const Topic<msg::Cancel> kTaskCancel{"rt/task/cancel", kCommand};
inline const Topic<msg::TaskRun> kTaskRun{"rt/task/run", kLatched};
inline const Topic<msg::Observation> kTaskObservation{"rt/task/observation", kCommand};
inline const Topic<msg::Plan> kTaskPlan{"rt/task/plan", kCommand};
inline const Topic<msg::Feedback> kTaskFeedback{"rt/task/feedback", kState};
inline const Topic<msg::GoalResult> kTaskResult{"rt/task/result", kAnswer};

/// The pool's topics are everybody's, whatever robot they plan for.
inline const Topic<msg::WorkerHeartbeat> kPoolWorker{"rt/pool/worker", kState, Scope::kDomain};
inline const Topic<msg::WorldDescription> kPoolWorld{"rt/pool/world", kCatalogue, Scope::kDomain};
inline const Topic<msg::BatchControl> kPoolControl{"rt/pool/control", kTask, Scope::kDomain};
inline const Topic<msg::AssignmentResults> kPoolResult{"rt/pool/result", kTask, Scope::kDomain};

/// These are for bags that are played.
inline const Topic<msg::PlayControl> kPlayControl{"rt/play/control", kCommand};
inline const Topic<msg::PlayStatus> kPlayStatus{"rt/play/status", kLatched};

/// The time in the stamps of robot and objects: a simulated world's, or that of a bag which is played.
inline const Topic<rosgraph_msgs::msg::Clock> kClock{"rt/clock", kState};

/// Returns all of the above, in their order.
inline auto all() {
  return std::tie(kJointStates, kTransforms, kObjectPoses, kObjectStates, kDiagnostics, kRobotCommand, kRobotStatus,
                  kTaskGoal, kTaskCancel, kTaskRun, kTaskObservation, kTaskPlan, kTaskFeedback, kTaskResult,
                  kPoolWorker, kPoolWorld, kPoolControl, kPoolResult, kPlayControl, kPlayStatus, kClock);
}

/// Returns the topic on which one worker gets its assignments. On a shared topic each assignment would reach
/// all workers (32 workers: 22.5 ms against 2.7 ms).
inline Topic<msg::Assignment> pool_assignment(std::uint64_t worker) {
  return {fmt::format("rt/pool/assignment/w{:016x}", worker), kTask, Scope::kDomain};
}

}  // namespace jostle::wire::topics
