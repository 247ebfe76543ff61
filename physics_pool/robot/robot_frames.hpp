#pragma once
/// \file
/// A robot as ROS 2's tools want it: a tree of frames with one joint each, and URDF.

#include <span>
#include <string>
#include <vector>

#include "idl/types/transform.hpp"
#include "physics_pool/robot/robot_model.hpp"

namespace jostle::physics_pool {

/// A frame hangs on its parent by one joint at most. It is a link's, or stands between two joints of one link.
struct RobotFrame {
  std::string name;
  int parent = -1;  ///< an earlier frame; -1: the world
  Pose pose;        ///< X_PF with its joint at 0
  int joint = -1;   ///< -1: fixed to its parent
  int link = -1;    ///< -1: it is no link's

  bool operator==(const RobotFrame&) const = default;
};

/// Returns the frames of a robot, parents before children. The first is the root, fixed in the world at `base` (X_WB).
/// Links give their frames their names, joints those between; a robot whose first link is not all of its base has a
/// root of its own, robot_base. Who would be called as one in `taken` gets an underscore more.
std::vector<RobotFrame> robot_frames(const RobotModel& model, const Pose& base, const std::vector<std::string>& taken);

/// Returns X_PF of a frame. `q` [joints].
Eigen::Isometry3d frame_pose(const RobotModel& model, const RobotFrame& frame, std::span<const double> q);

/// Writes a robot as URDF, its links being `frames`; what a link looks like is also what it collides with. Meshes
/// become the boxes around them, slides without an end get one at 1 km, and axes that move several joints are told of
/// by nothing: the joints are. Source   wiki.ros.org/urdf/XML
std::string to_urdf(const RobotModel& model, const std::vector<RobotFrame>& frames);

}  // namespace jostle::physics_pool
