#include "physics_pool/task/task_geometry.hpp"

#include <algorithm>
#include <cmath>

namespace jostle::physics_pool {
namespace {

RobotModel without_geoms(const RobotModel& robot) {
  RobotModel bare = robot;
  for (Link& link : bare.links) link.geoms.clear();
  return bare;
}

bool intrudes(const TaskGeometry& geometry, const StateView& view, std::size_t i) {
  const Disc& goal = geometry.task.goal;
  return geometry.kind->has_goal && !view.is_target(i) &&
         squared_distance(goal, view.object(i).position()) <= goal.radius * goal.radius;
}

bool is_dropped(const TaskGeometry& geometry, const StateView& view, std::size_t i, double height) {
  return view.object(i).position()[2] < geometry.rest_heights[i] - height;
}

// Indices of the objects of which something holds.
template <class Predicate>
std::vector<int> objects_that(const StateView& view, Predicate holds) {
  std::vector<int> found;
  for (std::size_t i = 0; i < view.objects(); ++i) {
    if (holds(i)) found.push_back(static_cast<int>(i));
  }
  return found;
}

// How many: nothing is allocated, as costs ask for it in every step.
template <class Predicate>
int count_of(const StateView& view, Predicate holds) {
  int count = 0;
  for (std::size_t i = 0; i < view.objects(); ++i) count += holds(i) ? 1 : 0;
  return count;
}

}  // namespace

TaskGeometry::TaskGeometry(const Scene& scene)
    : layout(layout_of(scene)),
      surface(scene.surface),
      task(scene.task),
      kind(find_task_kind(scene.task.kind)),
      target(scene.objects.at(static_cast<std::size_t>(layout.target))),
      robot(without_geoms(scene.robot.model)),
      base(transform(scene.robot.base)),
      reaches(axis_reaches(scene.robot.model)),
      planar(as_planar(scene.robot.model)),
      disc_radius(physics_pool::disc_radius(scene.robot.model).value_or(0.0)) {
  target.name.clear();  // a copy must not allocate
  target.parts.clear();
  for (const SceneObject& object : scene.objects) {
    rest_heights.push_back(object.rest_height());
    tops.push_back(object.top());
    footprints.push_back(object.reach());
    round.push_back(object.shape == Shape::kCylinder && object.parts.empty());
  }
}

Eigen::Isometry3d tool_pose(const TaskGeometry& geometry, const State& x) {
  return tool_pose(geometry.robot, geometry.base, geometry.view(x).joints());
}

InTool in_tool(const TaskGeometry& geometry, const State& x, const double* position) {
  const Eigen::Isometry3d X_WT = tool_pose(geometry, x);
  const auto& R = X_WT.linear();
  const auto& p = X_WT.translation();
  const double dx = position[0] - p.x(), dy = position[1] - p.y(), dz = position[2] - p.z();
  const auto along = [&](int axis) { return R(0, axis) * dx + R(1, axis) * dy + R(2, axis) * dz; };
  return {.forward = along(0), .left = along(1), .up = along(2)};
}

double squared_distance(const Disc& disc, const double* position) {
  const double dx = position[0] - disc.x, dy = position[1] - disc.y;
  return dx * dx + dy * dy;
}

bool is_level_with(const TaskGeometry& geometry, std::size_t object, double up) {
  if (geometry.planar) return true;
  const double height = geometry.rest_heights[object] - up;
  return height >= 0 && height <= geometry.tops[object];
}

TargetBearing target_bearing(const TaskGeometry& geometry, const State& x) {
  const InTool p = in_tool(geometry, x, geometry.view(x).target().position());
  return {.distance = geometry.planar ? std::hypot(p.forward, p.left) : std::hypot(p.forward, p.left, p.up),
          .angle = std::abs(std::atan2(p.left, p.forward))};
}

bool in_pre_grasp_region(const TaskGeometry& geometry, const State& x) {
  const Hand& hand = *geometry.robot.hand;
  const StateView view = geometry.view(x);
  const std::span<const double> q = view.joints();
  const InTool p = in_tool(geometry, x, view.target().position());
  return p.forward >= hand.near && p.forward <= hand.far &&
         p.left <= std::min(hand.side, q[static_cast<std::size_t>(hand.left)]) &&
         p.left >= -std::min(hand.side, q[static_cast<std::size_t>(hand.right)]) &&
         is_level_with(geometry, static_cast<std::size_t>(geometry.layout.target), p.up);
}

int count_obstructions(const TaskGeometry& geometry, const State& x) {
  if (!geometry.robot.hand) return 0;
  const Hand& hand = *geometry.robot.hand;
  const StateView view = geometry.view(x);
  const std::span<const double> q = view.joints();
  const double left = q[static_cast<std::size_t>(hand.left)], right = q[static_cast<std::size_t>(hand.right)];
  return count_of(view, [&](std::size_t i) {
    if (view.is_target(i)) return false;
    const InTool p = in_tool(geometry, x, view.object(i).position());
    return p.forward >= 0 && p.forward <= hand.finger_length && p.left <= left && p.left >= -right &&
           is_level_with(geometry, i, p.up);
  });
}

std::vector<int> intruders(const TaskGeometry& geometry, const State& x) {
  const StateView view = geometry.view(x);
  return objects_that(view, [&](std::size_t i) { return intrudes(geometry, view, i); });
}

int count_intruders(const TaskGeometry& geometry, const State& x) {
  const StateView view = geometry.view(x);
  return count_of(view, [&](std::size_t i) { return intrudes(geometry, view, i); });
}

bool target_hits_obstacle(const TaskGeometry& geometry, const State& x) {
  if (!geometry.task.obstacle) return false;
  const ObjectView seen = geometry.view(x).target();
  SceneObject target = geometry.target;
  target.x = seen.position()[0];
  target.y = seen.position()[1];
  target.yaw = seen.yaw();
  return signed_distance(target, *geometry.task.obstacle) < 0;
}

bool pusher_hits_obstacle(const TaskGeometry& geometry, const State& x) {
  if (!geometry.task.obstacle) return false;
  const double reach = geometry.disc_radius + geometry.task.obstacle->radius;
  return squared_distance(*geometry.task.obstacle, tool_pose(geometry, x).translation().data()) < reach * reach;
}

int count_collisions(const TaskGeometry& geometry, const State& x) {
  return (target_hits_obstacle(geometry, x) ? 1 : 0) + (pusher_hits_obstacle(geometry, x) ? 1 : 0);
}

std::vector<int> dropped_objects(const TaskGeometry& geometry, const State& x, double height) {
  const StateView view = geometry.view(x);
  return objects_that(view, [&](std::size_t i) { return is_dropped(geometry, view, i, height); });
}

int count_dropped(const TaskGeometry& geometry, const State& x, double height) {
  const StateView view = geometry.view(x);
  return count_of(view, [&](std::size_t i) { return is_dropped(geometry, view, i, height); });
}

int toppled_objects(const TaskGeometry& geometry, const State& x, double angle) {
  const StateView view = geometry.view(x);
  const double least = std::cos(angle);
  return count_of(view, [&](std::size_t i) { return view.object(i).uprightness() < least; });
}

std::string names_of(const StateLayout& layout, const std::vector<int>& objects) {
  std::string names;
  for (const int i : objects) {
    names += (names.empty() ? "" : ", ") + layout.objects[static_cast<std::size_t>(i)].name;
  }
  return names;
}

}  // namespace jostle::physics_pool
