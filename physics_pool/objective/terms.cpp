#include "physics_pool/objective/terms.hpp"

#include <algorithm>
#include <cmath>

#include "physics_pool/scene/planar_gripper.hpp"

namespace jostle::physics_pool {
namespace {

// An object's centre in the hand's frame, m.
struct InHand {
  double forward = 0.0, left = 0.0;
};

InHand in_hand(const ObjectSlot& object, const State& x) {
  const int q = object.q;
  const double dx = x.q[q] - x.q[kJointX], dy = x.q[q + 1] - x.q[kJointY];
  const double c = std::cos(x.q[kJointRotation]), s = std::sin(x.q[kJointRotation]);
  return {.forward = c * dx + s * dy, .left = -s * dx + c * dy};
}

InHand target_in_hand(const TaskGeometry& geometry, const State& x) {
  return in_hand(geometry.layout.objects[static_cast<std::size_t>(geometry.layout.target)], x);
}

double squared_distance(const double* a, const double* b) {
  const double dx = a[0] - b[0], dy = a[1] - b[1], dz = a[2] - b[2];
  return dx * dx + dy * dy + dz * dz;
}

// Squared angle of the rotation between two quaternions, rad^2.
double squared_rotation(const double* a, const double* b) {
  const double dot = std::abs(a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]);
  const double angle = 2 * std::acos(std::min(dot, 1.0));
  return angle * angle;
}

// z component of the body's z axis in the world: the cosine of its tilt.
double upright(const double* quaternion) {
  return 1 - 2 * (quaternion[1] * quaternion[1] + quaternion[2] * quaternion[2]);
}

// [x, y, ...] of object i in the world, m.
const double* position(const TaskGeometry& geometry, const State& x, std::size_t i) {
  return &x.q[static_cast<std::size_t>(geometry.layout.objects[i].q)];
}

double squared_distance(const Disc& disc, const double* p) {
  const double dx = p[0] - disc.x, dy = p[1] - disc.y;
  return dx * dx + dy * dy;
}

bool intrudes(const TaskGeometry& geometry, const State& x, std::size_t i) {
  const Disc& goal = geometry.task.goal;
  return geometry.task.is_push() && static_cast<int>(i) != geometry.layout.target &&
         squared_distance(goal, position(geometry, x, i)) <= goal.radius * goal.radius;
}

bool is_dropped(const TaskGeometry& geometry, const State& x, std::size_t i, double height) {
  return x.q[geometry.layout.objects[i].q + 2] < geometry.rest_heights[i] - height;
}

}  // namespace

TaskGeometry::TaskGeometry(const Scene& scene)
    : layout(layout_of(scene)),
      half_x(scene.surface.size[0] / 2),
      half_y(scene.surface.size[1] / 2),
      task(scene.task),
      target(scene.objects.at(static_cast<std::size_t>(layout.target))),
      pusher_radius(scene.robot.is_pusher() ? scene.robot.radius : 0.0) {
  target.name.clear();  // a copy must not allocate
  for (const SceneObject& object : scene.objects) rest_heights.push_back(object.rest_height());
}

TargetBearing target_bearing(const TaskGeometry& geometry, const State& x) {
  const InHand p = target_in_hand(geometry, x);
  return {.distance = std::hypot(p.forward, p.left), .angle = std::abs(std::atan2(p.left, p.forward))};
}

double goal_distance(const TaskGeometry& geometry, const State& x) {
  if (!geometry.task.is_push()) return target_bearing(geometry, x).distance;
  const auto target = static_cast<std::size_t>(geometry.layout.target);
  return std::sqrt(squared_distance(geometry.task.goal, position(geometry, x, target)));
}

double goal_cost(const TaskGeometry& geometry, const State& x, double angle_weight) {
  if (geometry.task.is_push()) {
    const auto target = static_cast<std::size_t>(geometry.layout.target);
    return squared_distance(geometry.task.goal, position(geometry, x, target));
  }
  const TargetBearing bearing = target_bearing(geometry, x);
  return bearing.distance * bearing.distance + angle_weight * bearing.angle * bearing.angle;
}

int count_obstructions(const TaskGeometry& geometry, const State& x) {
  if (geometry.task.is_push()) return 0;
  int count = 0;
  for (std::size_t i = 0; i < geometry.layout.objects.size(); ++i) {
    if (static_cast<int>(i) == geometry.layout.target) continue;
    const InHand p = in_hand(geometry.layout.objects[i], x);
    const bool between = p.forward >= 0 && p.forward <= planar_gripper::kFingerLength && p.left <= x.q[kJointLeft] &&
                         p.left >= -x.q[kJointRight];
    count += between ? 1 : 0;
  }
  return count;
}

double final_cost(const TaskGeometry& geometry, const Objective& objective, const State& x) {
  return objective.goal * goal_cost(geometry, x, objective.angle) +
         objective.obstruction * count_obstructions(geometry, x);
}

double acceleration_cost(std::span<const double> u_before, std::span<const double> u) {
  double sum = 0.0;
  for (std::size_t i = 0; i < u.size(); ++i) sum += (u[i] - u_before[i]) * (u[i] - u_before[i]);
  return sum;
}

double disturbance_cost(const TaskGeometry& geometry, const State& x0, const State& x1, double rotation_weight) {
  double sum = 0.0;
  for (int i = 0; i < static_cast<int>(geometry.layout.objects.size()); ++i) {
    if (i == geometry.layout.target) continue;
    const int q = geometry.layout.objects[i].q;
    sum += squared_distance(&x0.q[q], &x1.q[q]);
    if (rotation_weight > 0) sum += rotation_weight * squared_rotation(&x0.q[q + 3], &x1.q[q + 3]);
  }
  return sum;
}

double edge_cost(const TaskGeometry& geometry, const State& x0, const State& x1, const Objective& objective) {
  double sum = 0.0;
  for (const ObjectSlot& object : geometry.layout.objects) {
    const double* p = &x1.q[object.q];
    if (std::abs(p[0]) <= geometry.half_x - objective.edge_margin &&
        std::abs(p[1]) <= geometry.half_y - objective.edge_margin) {
      continue;
    }
    const double pushed = std::sqrt(squared_distance(&x0.q[object.q], p));
    sum += std::exp(std::min(objective.edge_rate * pushed, objective.edge_exponent_max));
  }
  return sum;
}

int toppled_objects(const TaskGeometry& geometry, const State& x, double angle) {
  const double least = std::cos(angle);
  return static_cast<int>(std::ranges::count_if(geometry.layout.objects,
                                                [&](const ObjectSlot& o) { return upright(&x.q[o.q + 3]) < least; }));
}

double obstacle_cost(const TaskGeometry& geometry, const State& x, const Objective& objective) {
  if (!geometry.task.obstacle) return 0.0;
  const auto nearness = [&](const double* p) {
    const double nearest = objective.obstacle_nearest * objective.obstacle_nearest;
    return 1 / std::max(squared_distance(*geometry.task.obstacle, p), nearest);
  };
  const auto target = static_cast<std::size_t>(geometry.layout.target);
  return objective.obstacle_target * nearness(position(geometry, x, target)) +
         objective.obstacle_pusher * nearness(&x.q[kJointX]);
}

std::vector<int> intruders(const TaskGeometry& geometry, const State& x) {
  std::vector<int> inside;
  for (std::size_t i = 0; i < geometry.layout.objects.size(); ++i) {
    if (intrudes(geometry, x, i)) inside.push_back(static_cast<int>(i));
  }
  return inside;
}

int count_intruders(const TaskGeometry& geometry, const State& x) {
  int count = 0;
  for (std::size_t i = 0; i < geometry.layout.objects.size(); ++i) count += intrudes(geometry, x, i) ? 1 : 0;
  return count;
}

bool target_hits_obstacle(const TaskGeometry& geometry, const State& x) {
  if (!geometry.task.obstacle) return false;
  const double* p = position(geometry, x, static_cast<std::size_t>(geometry.layout.target));
  SceneObject target = geometry.target;
  target.x = p[0];
  target.y = p[1];
  const double* quaternion = p + 3;
  target.yaw = std::atan2(2 * (quaternion[0] * quaternion[3] + quaternion[1] * quaternion[2]),
                          1 - 2 * (quaternion[2] * quaternion[2] + quaternion[3] * quaternion[3]));
  return signed_distance(target, *geometry.task.obstacle) < 0;
}

bool pusher_hits_obstacle(const TaskGeometry& geometry, const State& x) {
  if (!geometry.task.obstacle) return false;
  const double reach = geometry.pusher_radius + geometry.task.obstacle->radius;
  return squared_distance(*geometry.task.obstacle, &x.q[kJointX]) < reach * reach;
}

int count_collisions(const TaskGeometry& geometry, const State& x) {
  return (target_hits_obstacle(geometry, x) ? 1 : 0) + (pusher_hits_obstacle(geometry, x) ? 1 : 0);
}

std::vector<int> dropped_objects(const TaskGeometry& geometry, const State& x, double height) {
  std::vector<int> dropped;
  for (std::size_t i = 0; i < geometry.layout.objects.size(); ++i) {
    if (is_dropped(geometry, x, i, height)) dropped.push_back(static_cast<int>(i));
  }
  return dropped;
}

int count_dropped(const TaskGeometry& geometry, const State& x, double height) {
  int count = 0;
  for (std::size_t i = 0; i < geometry.layout.objects.size(); ++i) {
    count += is_dropped(geometry, x, i, height) ? 1 : 0;
  }
  return count;
}

bool at_goal(const TaskGeometry& geometry, const State& x, const Objective& objective) {
  const auto target = static_cast<std::size_t>(geometry.layout.target);
  if (is_dropped(geometry, x, target, objective.drop_height) ||
      upright(&x.q[geometry.layout.objects[target].q + 3]) < std::cos(objective.topple_angle)) {
    return false;
  }
  if (geometry.task.is_push()) return goal_distance(geometry, x) <= geometry.task.goal.radius;
  namespace hand = planar_gripper;
  const InHand p = target_in_hand(geometry, x);
  return p.forward >= hand::kGraspNear && p.forward <= hand::kGraspFar &&
         p.left <= std::min(hand::kGraspSide, x.q[kJointLeft]) &&
         p.left >= -std::min(hand::kGraspSide, x.q[kJointRight]);
}

double running_cost(const TaskGeometry& geometry, const Objective& objective, std::span<const double> u_before,
                    std::span<const double> u, const State& x0, const State& x1) {
  return objective.acceleration * acceleration_cost(u_before, u) +
         objective.disturbance * disturbance_cost(geometry, x0, x1, objective.disturbance_rotation) +
         objective.edge * edge_cost(geometry, x0, x1, objective) +
         objective.topple * toppled_objects(geometry, x1, objective.topple_angle) +
         objective.drop * count_dropped(geometry, x1, objective.drop_height) + obstacle_cost(geometry, x1, objective) +
         objective.collision * count_collisions(geometry, x1) + objective.intrusion * count_intruders(geometry, x1);
}

}  // namespace jostle::physics_pool
