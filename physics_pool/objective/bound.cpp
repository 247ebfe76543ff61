#include "physics_pool/objective/bound.hpp"

#include <algorithm>
#include <cmath>

#include "physics_pool/objective/terms.hpp"
#include "physics_pool/task/kinds.hpp"

namespace jostle::physics_pool {
namespace {

constexpr double kSlack = 0.005;  // m; contacts give way by a fraction of a millimetre

struct Speeds {
  double translation, turning, finger;  // m/s, rad/s, m/s
};

// The speeds of the hand of a robot that moves in the plane.
Speeds speeds(const TaskGeometry& geometry, std::span<const double> u) {
  const auto of = [&](int axis) { return axis < 0 ? 0.0 : u[static_cast<std::size_t>(axis)]; };
  return {.translation = std::hypot(of(geometry.planar->x), of(geometry.planar->y)),
          .turning = std::abs(of(geometry.planar->rotation)),
          .finger = std::abs(of(geometry.robot.hand->opening)) / 2};
}

Speeds larger(const Speeds& a, const Speeds& b) {
  return {.translation = std::max(a.translation, b.translation),
          .turning = std::max(a.turning, b.turning),
          .finger = std::max(a.finger, b.finger)};
}

}  // namespace

Outlook outlook(const TaskGeometry& geometry, const Objective& objective, const ControlSequence& controls, int done,
                std::span<const double> u_before, const State& x, double step_duration) {
  Outlook outlook;
  const bool grasps = geometry.kind == &kGrasp && geometry.planar && geometry.robot.hand;
  const double distance = grasps ? target_bearing(geometry, x).distance : 0.0;
  double approach = kSlack, travelled = 0.0;
  std::span<const double> before = u_before;
  for (int t = done; t < controls.steps(); ++t) {
    const std::span<const double> u = controls.step(t);
    outlook.cost += objective.weight("acceleration") * acceleration_cost(before, u);
    if (grasps) {
      const Speeds fastest = larger(speeds(geometry, before), speeds(geometry, u));
      travelled += fastest.translation * step_duration;
      approach += (2 * fastest.translation + fastest.turning * (distance + travelled) + fastest.finger) * step_duration;
    }
    before = u;
  }
  outlook.cost += objective.weight("drop") * count_dropped(geometry, x, objective.value("drop", "height")) *
                  (controls.steps() - done);
  if (!grasps) return outlook;
  const double nearest = std::max(distance - approach, 0.0);
  outlook.cost += objective.weight("goal") * nearest * nearest;
  outlook.may_succeed = nearest <= std::hypot(geometry.robot.hand->far, geometry.robot.hand->side);
  return outlook;
}

}  // namespace jostle::physics_pool
