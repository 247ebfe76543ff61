#pragma once
/// \file
/// Small scenes whose physics one can work out by hand.

#include <string>

#include "physics_pool/scene/scene.hpp"

namespace jostle::tests {

inline physics_pool::SceneObject box(std::string name, double x, double y, double yaw = 0.0) {
  return {.name = std::move(name),
          .shape = physics_pool::Shape::kBox,
          .size = {0.04, 0.04, 0.038},
          .mass = 0.5,
          .friction = 0.4,
          .x = x,
          .y = y,
          .yaw = yaw};
}

inline physics_pool::SceneObject cylinder(std::string name, double x, double y) {
  return {.name = std::move(name),
          .shape = physics_pool::Shape::kCylinder,
          .radius = 0.0375,
          .height = 0.05,
          .mass = 0.4,
          .friction = 0.3,
          .x = x,
          .y = y};
}

/// A table with the robot at its edge and the target, a box, in the middle.
inline physics_pool::Scene target_only() {
  physics_pool::Scene scene;
  scene.name = "target only";
  scene.robot = {.x = -0.33, .opening = 0.085};
  scene.objects = {box("target", 0.0, 0.0)};
  scene.task.target = "target";
  return scene;
}

/// The same with a cylinder left and a box right of the target.
inline physics_pool::Scene three_objects() {
  physics_pool::Scene scene = target_only();
  scene.name = "three objects";
  scene.objects.push_back(cylinder("can", 0.05, 0.12));
  scene.objects.push_back(box("carton", 0.1, -0.1, 0.5));
  return scene;
}

}  // namespace jostle::tests
