#pragma once
/// \file
/// A scene and a plan as markers: what RViz and Foxglove draw.

#include "idl/msg/display.h"
#include "idl/msg/task.h"
#include "physics_pool/scene/scene.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::task {

/// Returns what a scene has beside its robot: surface, fixtures, goal and obstacle in the frame `world`, every object
/// in the frame of its name, so that it moves as /tf says. What was drawn before is deleted first.
visualization_msgs::msg::MarkerArray scene_markers(const physics_pool::Scene& scene);

/// Returns where a plan takes the target and the robot's tool, as lines in the frame `world`, stamped as the plan is.
/// Each replaces that of the plan before.
visualization_msgs::msg::MarkerArray plan_markers(const physics_pool::TaskGeometry& geometry,
                                                  const jostle_msgs::msg::Plan& plan);

/// Returns the word that deletes all markers of a topic.
visualization_msgs::msg::MarkerArray no_markers();

}  // namespace jostle::task
