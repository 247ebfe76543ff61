#include "physics_pool/objective/bound.hpp"

#include <algorithm>
#include <cmath>

#include "physics_pool/scene/planar_gripper.hpp"

namespace jostle::physics_pool {
namespace {

namespace hand = planar_gripper;

constexpr double kSlack = 0.005;  // m; contacts give way by a fraction of a millimetre

struct Speeds {
  double translation, turning, finger;  // m/s, rad/s, m/s
};

Speeds speeds(std::span<const double> u) {
  return {.translation = std::hypot(u[kControlX], u[kControlY]),
          .turning = std::abs(u[kControlRotation]),
          .finger = std::abs(u[kControlOpening]) / 2};
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
  const bool grasps = !geometry.task.is_push();
  const double distance = grasps ? target_bearing(geometry, x).distance : 0.0;
  double approach = kSlack, travelled = 0.0;
  std::span<const double> before = u_before;
  for (int t = done; t < controls.steps(); ++t) {
    const std::span<const double> u = controls.step(t);
    outlook.cost += objective.acceleration * acceleration_cost(before, u);
    if (grasps) {
      const Speeds fastest = larger(speeds(before), speeds(u));
      travelled += fastest.translation * step_duration;
      approach += (2 * fastest.translation + fastest.turning * (distance + travelled) + fastest.finger) * step_duration;
    }
    before = u;
  }
  outlook.cost += objective.drop * count_dropped(geometry, x, objective.drop_height) * (controls.steps() - done);
  if (!grasps) return outlook;
  const double nearest = std::max(distance - approach, 0.0);
  outlook.cost += objective.goal * nearest * nearest;
  outlook.may_succeed = nearest <= std::hypot(hand::kGraspFar, hand::kGraspSide);
  return outlook;
}

}  // namespace jostle::physics_pool
