// Bring the target's centre into the goal region, neither it nor the robot over the obstacle, nothing else into
// the region (Sec. 6.2, 7.1).

#include <fmt/format.h>

#include <cmath>

#include "physics_pool/task/kinds.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::physics_pool {
namespace {

std::string misfit(const Scene& scene) {
  if (as_planar(scene.robot.model)) return "";
  return fmt::format("got 'push' for the robot '{}', wanted one that moves in the plane", scene.robot.model.name);
}

// |p_T - p_goal|^2; a push has no bearing.
double cost(const TaskGeometry& geometry, const State& x, double) {
  return squared_distance(geometry.task.goal, geometry.view(x).target().position());
}

double distance(const TaskGeometry& geometry, const State& x) { return std::sqrt(cost(geometry, x, 0.0)); }

bool reached(const TaskGeometry& geometry, const State& x) {
  return distance(geometry, x) <= geometry.task.goal.radius;
}

std::string failure(const TaskGeometry& geometry, const State& x) {
  if (target_hits_obstacle(geometry, x)) return "target hit the obstacle";
  if (pusher_hits_obstacle(geometry, x)) return "pusher hit the obstacle";
  const auto inside = intruders(geometry, x);
  return inside.empty() ? "" : fmt::format("{} in the goal region", names_of(geometry.layout, inside));
}

}  // namespace

constexpr TaskKind kPush{.name = "push",
                         .purpose = "bring the target's centre into the goal region (Sec. 6.2, 7.1)",
                         .achieved = "target in the goal region",
                         .has_goal = true,
                         .misfit = misfit,
                         .cost = cost,
                         .distance = distance,
                         .distance_at_end = nullptr,
                         .reached = reached,
                         .failure = failure};

}  // namespace jostle::physics_pool
