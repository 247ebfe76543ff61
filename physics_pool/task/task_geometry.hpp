#pragma once
/// \file
/// What tasks and costs need to know of a scene, and measures that several of them take.

#include <optional>
#include <vector>

#include "idl/types/state.hpp"
#include "physics_pool/robot/kinematics.hpp"
#include "physics_pool/scene/scene.hpp"
#include "physics_pool/scene/task_kind.hpp"

namespace jostle::physics_pool {

struct TaskGeometry {
  explicit TaskGeometry(const Scene& scene);

  StateLayout layout;
  Surface surface;
  std::vector<double> rest_heights;  ///< [objects] m
  std::vector<double> tops;          ///< [objects] m, how high each reaches above what it stands on
  std::vector<double> footprints;    ///< [objects] m, radius of the smallest disc around each, seen from above
  std::vector<bool> round;           ///< [objects] whether a turn about its own axis leaves it as it was
  SceneTask task;
  const TaskKind* kind;  ///< what task.kind means
  SceneObject target;    ///< the shape the target stands on, without its name; the state says where it is
  RobotModel robot;      ///< without its geoms, which cost copies and which nobody here asks for
  Eigen::Isometry3d base;
  std::vector<double> reaches;        ///< [nu] axis_reaches() of the robot
  std::optional<PlanarRobot> planar;  ///< how the robot moves in the plane, if it does
  double disc_radius = 0.0;           ///< m, of a robot that is a disc; 0 for others

  StateView view(const State& x) const { return {layout, x}; }
};

/// Returns X_WT of the hand's frame G, or of the robot's last link where it has no hand.
Eigen::Isometry3d tool_pose(const TaskGeometry& geometry, const State& x);

/// A point in the tool's frame, m.
struct InTool {
  double forward = 0.0, left = 0.0, up = 0.0;
};
InTool in_tool(const TaskGeometry& geometry, const State& x, const double* position);

double squared_distance(const Disc& disc, const double* position);  ///< in the plane, m^2

/// Whether a hand that is `up` below an object's centre (in_tool) is between the object's foot and its top. Always so
/// for robots that move in the plane: their hands are as high as what they grasp.
bool is_level_with(const TaskGeometry& geometry, std::size_t object, double up);

/// Distance and bearing of the target from the hand, Fig. 3.2. The distance is in the hand's plane, if the robot moves
/// in the plane; in space, if it does not.
struct TargetBearing {
  double distance = 0.0;  ///< d_T, m
  double angle = 0.0;     ///< phi_T, rad, in [0, pi]
};
TargetBearing target_bearing(const TaskGeometry& geometry, const State& x);

/// Whether the target's centre is in the pre-grasp region of the hand, which there must be, and the hand level with it.
bool in_pre_grasp_region(const TaskGeometry& geometry, const State& x);

/// Counts other objects whose centre lies between the fingers, palm to fingertips, the hand being level with them; 0
/// without a hand.
int count_obstructions(const TaskGeometry& geometry, const State& x);

/// Returns indices of the other objects whose centre is in the goal region; none where the task has no region.
std::vector<int> intruders(const TaskGeometry& geometry, const State& x);
int count_intruders(const TaskGeometry& geometry, const State& x);

/// Whether the target's, or a disc-shaped robot's, footprint is over the obstacle.
bool target_hits_obstacle(const TaskGeometry& geometry, const State& x);
bool pusher_hits_obstacle(const TaskGeometry& geometry, const State& x);
int count_collisions(const TaskGeometry& geometry, const State& x);  ///< how many of the two are

/// Returns indices of objects whose centre is more than `height` m below its resting place.
std::vector<int> dropped_objects(const TaskGeometry& geometry, const State& x, double height);
int count_dropped(const TaskGeometry& geometry, const State& x, double height);

/// How many objects' axes lean more than `angle` rad from upright.
int toppled_objects(const TaskGeometry& geometry, const State& x, double angle);

/// Writes names of objects by index, "a, b".
std::string names_of(const StateLayout& layout, const std::vector<int>& objects);

}  // namespace jostle::physics_pool
