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
  scene.robot = physics_pool::planar_gripper({.x = -0.33, .opening = 0.085});
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

/// The slider of Sec. 6.3, its centre at (x, y).
inline physics_pool::SceneObject slider(std::string name, double x, double y) {
  return {.name = std::move(name),
          .shape = physics_pool::Shape::kCylinder,
          .radius = 0.05115,
          .height = 0.0245,
          .mass = 0.5,
          .friction = 0.2,
          .x = x,
          .y = y};
}

/// A pusher 1 cm behind the target, the goal region ahead; no obstacle.
inline physics_pool::Scene push_ahead() {
  physics_pool::Scene scene;
  scene.name = "push ahead";
  scene.surface = physics_pool::Surface::table(1.0, 0.8);
  scene.objects = {slider("target", -0.2, 0.0)};
  scene.robot = physics_pool::pusher({.x = -0.2 - 0.05115 - 0.0145 - 0.01, .y = 0.0});
  scene.task = {.kind = "push", .target = "target", .goal = {.x = 0.2, .y = 0.0, .radius = 0.04}};
  scene.physics.time_step = 0.001;
  return scene;
}

/// The same with an obstacle halfway and another slider beside the way.
inline physics_pool::Scene push_around() {
  physics_pool::Scene scene = push_ahead();
  scene.name = "push around";
  scene.objects.push_back(slider("other", 0.0, 0.25));
  scene.task.obstacle = physics_pool::Disc{.x = 0.0, .y = 0.0, .radius = 0.04};
  return scene;
}

}  // namespace jostle::tests
