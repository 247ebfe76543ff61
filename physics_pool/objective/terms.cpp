#include "physics_pool/objective/terms.hpp"

#include <algorithm>
#include <cmath>

namespace jostle::physics_pool {
namespace {

double squared_distance(const double* a, const double* b) {
  const double dx = a[0] - b[0], dy = a[1] - b[1], dz = a[2] - b[2];
  return dx * dx + dy * dy + dz * dz;
}

}  // namespace

double acceleration_cost(std::span<const double> u_before, std::span<const double> u) {
  double sum = 0.0;
  for (std::size_t i = 0; i < u.size(); ++i) sum += (u[i] - u_before[i]) * (u[i] - u_before[i]);
  return sum;
}

double disturbance_cost(const TaskGeometry& geometry, const State& x0, const State& x1, double rotation_weight) {
  const StateView before = geometry.view(x0), after = geometry.view(x1);
  double sum = 0.0;
  for (std::size_t i = 0; i < before.objects(); ++i) {
    if (before.is_target(i)) continue;
    const ObjectView from = before.object(i), to = after.object(i);
    sum += squared_distance(from.position(), to.position());
    if (rotation_weight > 0) {
      const double angle = angle_between(from.orientation(), to.orientation());
      sum += rotation_weight * (angle * angle);
    }
  }
  return sum;
}

double edge_cost(const TaskGeometry& geometry, const State& x0, const State& x1, const EdgeCost& edge) {
  const StateView before = geometry.view(x0), after = geometry.view(x1);
  double sum = 0.0;
  for (std::size_t i = 0; i < before.objects(); ++i) {
    const double* p = after.object(i).position();
    if (geometry.surface.contains(p[0], p[1], edge.margin)) continue;
    const double pushed = std::sqrt(squared_distance(before.object(i).position(), p));
    sum += std::exp(std::min(edge.rate * pushed, edge.exponent_max));
  }
  return sum;
}

double rim_cost(const TaskGeometry& geometry, const State& x0, const State& x1, const RimCost& rim) {
  const StateView before = geometry.view(x0), after = geometry.view(x1);
  double sum = 0.0;
  for (std::size_t i = 0; i < before.objects(); ++i) {
    const double* p = after.object(i).position();
    const double* from = before.object(i).position();
    const double moved = std::hypot(p[0] - from[0], p[1] - from[1]);  // not how far it fell
    if (moved < rim.still || geometry.surface.contains(p[0], p[1], geometry.footprints[i] + rim.margin)) continue;
    sum += std::exp(std::min(rim.rate * moved, rim.exponent_max));
  }
  return sum;
}

double miss_cost(const TaskGeometry& geometry, const State& x) {
  if (!geometry.kind->has_goal) return 0.0;
  const double outside =
      std::sqrt(squared_distance(geometry.task.goal, geometry.view(x).target().position())) - geometry.task.goal.radius;
  return outside > 0 ? outside * outside : 0.0;
}

double pads_cost(const TaskGeometry& geometry, const State& x, double angle_weight) {
  if (!geometry.robot.hand) return 0.0;
  const InTool p = in_tool(geometry, x, geometry.view(x).target().position());
  const double ahead = p.forward - geometry.robot.hand->depth;
  const double angle = target_bearing(geometry, x).angle;
  const double beside = ahead * ahead + p.left * p.left;
  return (geometry.planar ? beside : beside + p.up * p.up) + angle_weight * (angle * angle);
}

double obstacle_cost(const TaskGeometry& geometry, const State& x, const ObstacleCost& obstacle) {
  if (!geometry.task.obstacle) return 0.0;
  const auto nearness = [&](const double* p) {
    const double nearest = obstacle.nearest * obstacle.nearest;
    return 1 / std::max(physics_pool::squared_distance(*geometry.task.obstacle, p), nearest);
  };
  return obstacle.target * nearness(geometry.view(x).target().position()) +
         obstacle.pusher * nearness(tool_pose(geometry, x).translation().data());
}

}  // namespace jostle::physics_pool
