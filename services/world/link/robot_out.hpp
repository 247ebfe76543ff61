#pragma once
/// \file
/// Where a robot's joints go: topics that ROS 2's tools read.

#include <chrono>
#include <span>
#include <string>
#include <vector>

#include "idl/types/state.hpp"
#include "physics_pool/robot/robot_frames.hpp"
#include "services/wire/dds/display_topics.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"

namespace jostle::world {

/// Says when transforms are due. tf2 complains of one that it has: while a world stands still, one a second serves who
/// comes late.
class TransformPace {
 public:
  /// `time`: s of the clock that stamps are of.
  bool is_due(double time);

 private:
  double time_ = -1.0;  // s, of the newest
  std::chrono::steady_clock::time_point next_{};
};

/// Publishes what a robot is, once for all who come (URDF, frames that never move), and where its joints are: states
/// and transforms. Threads  one.
class RobotTopics {
 public:
  /// `base`: X_WB. `taken`: frames of others, as robot_frames() wants them.
  RobotTopics(const wire::Participant& participant, physics_pool::RobotModel model, const Pose& base,
              std::vector<std::string> taken);

  /// `x`: the robot's joints first. `time`: s of the clock that stamps are of.
  void tell(const State& x, double time);

 private:
  geometry_msgs::msg::TransformStamped transform_of(const physics_pool::RobotFrame& frame, std::span<const double> q,
                                                    double time) const;

  const physics_pool::RobotModel model_;
  const std::vector<physics_pool::RobotFrame> frames_;
  const StateLayout layout_;  // of the joints alone
  TransformPace pace_;
  wire::Writer<sensor_msgs::msg::JointState> joints_;
  wire::Writer<tf2_msgs::msg::TFMessage> transforms_, static_transforms_;
  wire::Writer<std_msgs::msg::String> description_;
};

}  // namespace jostle::world
