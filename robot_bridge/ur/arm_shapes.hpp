#pragma once
/// \file
/// What room a UR5 with a gripper takes, and what it would touch there.

#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "robot_bridge/ur/kinematics.hpp"

namespace jostle::robot_bridge::ur {

/// All points within `radius` of a segment.
struct Capsule {
  Eigen::Vector3d a{0, 0, 0}, b{0, 0, 0};  ///< m
  double radius = 0.0;                     ///< m
};

/// A body that never moves.
struct Obstacle {
  std::string name;
  Eigen::Isometry3d X_WF = Eigen::Isometry3d::Identity();  ///< of its centre
  Eigen::Vector3d half{0, 0, 0};                           ///< of a box's extents, m
};

/// Parts of the arm, from the base on.
enum class Part { kBase, kShoulder, kUpperArm, kForearm, kWrist1, kWrist2, kWrist3, kGripper };
const char* to_string(Part part);

struct PartShape {
  Part part = Part::kBase;
  Capsule capsule;  ///< in the base
};

/// Returns the capsules round the arm's parts; those of a 2F-85 on the flange are part of it.
/// Source  capsules fitted to the maker's meshes, and rounded up
std::vector<PartShape> arm_shapes(const Joints& q);

/// Return the least distance between two, m; below 0: they overlap.
double distance(const Capsule& a, const Capsule& b);
double distance(const Capsule& capsule, const Obstacle& obstacle);

/// Returns what an arm at joints q would touch: itself, the plane z = 0 of the world (with what is beyond the
/// shoulder), or an obstacle. Nothing if it is free. `X_WB`: its base.
std::optional<std::string> touched(const Joints& q, const Eigen::Isometry3d& X_WB, std::span<const Obstacle> obstacles);

}  // namespace jostle::robot_bridge::ur
