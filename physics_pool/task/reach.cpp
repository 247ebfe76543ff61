// Bring the robot's tool to the target (Ch. 4).

#include <cmath>

#include "physics_pool/task/kinds.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::physics_pool {
namespace {

constexpr double kReached = 0.05;  // m, tool to the target's centre

std::string misfit(const Scene&) { return ""; }

double distance(const TaskGeometry& geometry, const State& x) {
  const InTool p = in_tool(geometry, x, geometry.view(x).target().position());
  return std::hypot(p.forward, p.left, p.up);
}

double cost(const TaskGeometry& geometry, const State& x, double) {
  const double d = distance(geometry, x);
  return d * d;
}

bool reached(const TaskGeometry& geometry, const State& x) { return distance(geometry, x) <= kReached; }

std::string failure(const TaskGeometry&, const State&) { return ""; }

}  // namespace

constexpr TaskKind kReach{.name = "reach",
                          .purpose = "bring the robot's tool within 5 cm of the target's centre (Ch. 4)",
                          .achieved = "target reached",
                          .has_goal = false,
                          .misfit = misfit,
                          .cost = cost,
                          .distance = distance,
                          .distance_at_end = [](const TaskGeometry&) { return kReached; },
                          .reached = reached,
                          .failure = failure};

}  // namespace jostle::physics_pool
