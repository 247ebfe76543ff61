#pragma once
/// \file
/// Robot models as text: files under models/, and the same lines inside a scene.

#include <filesystem>
#include <string>
#include <string_view>

#include "idl/types/result.hpp"
#include "physics_pool/robot/robot_model.hpp"

namespace jostle::yaml {
class Fields;
}

namespace jostle::physics_pool {

/// Reads a model from a mapping; throws yaml::Malformed. models/README.md documents the format.
RobotModel read_robot(yaml::Fields& fields);

/// Writes the canonical lines of a model, each with `indent` blanks before it: equal models give equal text, and
/// reading it back gives the same model bit for bit.
std::string robot_text(const RobotModel& model, int indent);

/// Returns a model that comes with every program: planar_gripper, pusher, ur5_2f85.
/// Error kNotFound naming those there are.
Result<RobotModel> builtin_robot(std::string_view name);

/// Where robots are looked for, and the `package://NAME/` of their meshes. An empty path opens no files at all: that
/// is for scenes that came from elsewhere.
struct RobotPath {
  std::filesystem::path base;                  ///< where relative paths begin: the scene file's folder
  std::vector<std::filesystem::path> folders;  ///< with models and ROS packages, searched in this order
};

/// Takes the folders from JOSTLE_MODELS, ROS_PACKAGE_PATH and, with `share` behind each, AMENT_PREFIX_PATH; all are
/// lists separated by colons.
RobotPath robot_path(const std::filesystem::path& base);

/// Finds a robot by what a scene calls it: the name of a built-in model, or a file NAME.yaml or NAME.urdf, relative
/// to the scene's or in one of the folders (also NAME/robot.yaml there). Without base and folders there are built-in
/// models only.
/// Errors   kNotFound          no such model; the message lists where it was looked for
///          kInvalidArgument   the file says something wrong; names file, line and remedy
Result<RobotModel> find_robot(const std::string& name, const RobotPath& path);

/// Reads a robot from a URDF (urdfdom): revolute, continuous, prismatic and fixed joints, limits, mimic
/// joints, inertias; boxes, cylinders, spheres and meshes (STL, OBJ: their convex hulls) of collisions. Every
/// joint that moves by itself becomes an axis, limited to its velocity; its drive holds the arm against gravity.
/// Source   wiki.ros.org/urdf/XML
/// Errors   kInvalidArgument  what is not supported (floating, planar joints, COLLADA meshes, scale that
///                            mirrors); names file, line, element and remedy
///          kNotFound         a mesh or its package; lists where it was looked for
Result<RobotModel> parse_urdf(const std::string& xml, const std::string& origin, const RobotPath& path);

}  // namespace jostle::physics_pool
