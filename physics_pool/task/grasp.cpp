// Bring the target into the hand (Ch. 3).

#include <fmt/format.h>

#include "physics_pool/task/kinds.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::physics_pool {
namespace {

std::string misfit(const Scene& scene) {
  if (scene.robot.model.hand) return "";
  return fmt::format("got 'grasp' for the robot '{}', which has no hand; wanted one that has, or another task",
                     scene.robot.model.name);
}

// c_g(x) = d_T^2 + w_phi·phi_T^2, Fig. 3.2.
double cost(const TaskGeometry& geometry, const State& x, double angle_weight) {
  const TargetBearing bearing = target_bearing(geometry, x);
  return bearing.distance * bearing.distance + angle_weight * bearing.angle * bearing.angle;
}

double distance(const TaskGeometry& geometry, const State& x) { return target_bearing(geometry, x).distance; }

double distance_at_end(const TaskGeometry& geometry) {
  const Hand& hand = *geometry.robot.hand;
  if (geometry.planar) return std::hypot(hand.far, hand.side);
  return std::hypot(hand.far, hand.side, geometry.tops[static_cast<std::size_t>(geometry.layout.target)]);
}

std::string failure(const TaskGeometry&, const State&) { return ""; }

}  // namespace

constexpr TaskKind kGrasp{.name = "grasp",
                          .purpose = "bring the target into the hand (Ch. 3)",
                          .achieved = "target grasped",
                          .has_goal = false,
                          .misfit = misfit,
                          .cost = cost,
                          .distance = distance,
                          .distance_at_end = distance_at_end,
                          .reached = in_pre_grasp_region,
                          .failure = failure};

}  // namespace jostle::physics_pool
