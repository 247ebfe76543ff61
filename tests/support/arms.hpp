#pragma once
/// \file
/// Arms: one whose kinematics one can do by hand, and one with everything that URDF has.

#include <filesystem>

#include "physics_pool/scene/scene.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::tests {

inline const std::filesystem::path kRobotFolder = std::filesystem::path(JOSTLE_SOURCE_DIR) / "tests/support/robots";

/// Joints and axes of seven_axis/seven_axis.urdf, by number.
enum SevenAxis : int { kAxis1, kAxis2, kAxis3, kAxis4, kAxis5, kAxis6, kAxis7, kFinger, kFingerFollower };
inline constexpr int kSevenAxisJoints = 9, kSevenAxisControls = 8;

inline physics_pool::RobotModel seven_axis() {
  return physics_pool::find_robot("seven_axis/seven_axis", physics_pool::robot_path(kRobotFolder)).value();
}

/// robots/seven_axis_reach.yaml
inline physics_pool::Scene seven_axis_reach() {
  return physics_pool::load_scene(kRobotFolder / "seven_axis_reach.yaml").value();
}

inline constexpr double kUpper = 0.3, kLower = 0.2;  // m, lengths of two_links()

/// An upper and a lower arm that turn about z, level 4 cm above the base, and a tool at the end. With joints a and b
/// the tool is at (0.3 cos a + 0.2 cos(a + b), 0.3 sin a + 0.2 sin(a + b)), turned by a + b.
inline physics_pool::RobotModel two_links() {
  using namespace physics_pool;
  const auto hinge = [](std::string name) {
    return Joint{.name = std::move(name), .low = -3, .high = 3, .armature = 1, .gain = 100, .force_limit = 100};
  };
  const auto bar = [](std::string name, double length) {
    return RobotGeom{
        .name = std::move(name), .size = {length, 0.03, 0.03}, .pose = {.position = {length / 2, 0, 0}}, .mass = 1};
  };
  RobotModel model{.name = "two links"};
  model.joints = {hinge("shoulder"), hinge("elbow")};
  model.links = {
      {.name = "upper", .pose = {.position = {0, 0, 0.04}}, .joints = {0}, .geoms = {bar("bar", kUpper)}},
      {.name = "lower", .parent = 0, .pose = {.position = {kUpper, 0, 0}}, .joints = {1}, .geoms = {bar("", kLower)}},
      {.name = "tool", .parent = 1, .pose = {.position = {kLower, 0, 0}}}};
  model.axes = {{.name = "shoulder", .joints = {{0, 1.0}}}, {.name = "elbow", .joints = {{1, 1.0}}}};
  model.carries_itself = true;
  return model;
}

/// two_links() at the left end of a table, stretched along +x from x = -0.4 to 0.1, its tool 10 cm short of the target.
inline physics_pool::Scene two_links_reach() {
  physics_pool::Scene scene;
  scene.name = "two links";
  scene.robot = {.model = two_links(), .base = {.position = {-0.4, 0, 0}}, .q = {0, 0}};
  scene.objects = {box("target", 0.2, 0.0)};
  scene.task = {.kind = "reach", .target = "target"};
  return scene;
}

}  // namespace jostle::tests
