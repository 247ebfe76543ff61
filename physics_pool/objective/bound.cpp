#include "physics_pool/objective/bound.hpp"

#include <algorithm>
#include <cmath>

#include "physics_pool/objective/terms.hpp"

namespace jostle::physics_pool {
namespace {

constexpr double kSlack = 0.005;  // m; contacts give way by a fraction of a millimetre

double faster(std::span<const double> a, std::span<const double> b, int axis) {
  if (axis < 0) return 0.0;
  const auto i = static_cast<std::size_t>(axis);
  return std::max(std::abs(a[i]), std::abs(b[i]));
}

// How much nearer target and tool may come in one control step, m.
class Approach {
 public:
  Approach(const TaskGeometry& geometry, double distance) : geometry_(geometry), distance_(distance) {}

  double step(std::span<const double> before, std::span<const double> u, double duration) {
    if (geometry_.planar && geometry_.robot.hand) return planar_hand(before, u, duration);
    double speed = 0.0;  // of the robot's fastest point
    for (std::size_t i = 0; i < u.size(); ++i) {
      const double axis = faster(before, u, static_cast<int>(i));
      if (axis > 0) speed += axis * geometry_.reaches[i];
    }
    return 2 * speed * duration;
  }

 private:
  double planar_hand(std::span<const double> before, std::span<const double> u, double duration) {
    const PlanarRobot& planar = *geometry_.planar;
    const auto length = [&](std::span<const double> v) {
      return std::hypot(v[static_cast<std::size_t>(planar.x)], v[static_cast<std::size_t>(planar.y)]);
    };
    const double translation = std::max(length(before), length(u));
    const double turning = faster(before, u, planar.rotation);
    const double finger = faster(before, u, geometry_.robot.hand->opening) / 2;
    travelled_ += translation * duration;
    return (2 * translation + turning * (distance_ + travelled_) + finger) * duration;
  }

  const TaskGeometry& geometry_;
  const double distance_;
  double travelled_ = 0.0;
};

}  // namespace

Outlook outlook(const TaskGeometry& geometry, const Objective& objective, const ControlSequence& controls, int done,
                std::span<const double> u_before, const State& x, double step_duration) {
  Outlook outlook;
  const bool foretells = geometry.kind->distance_at_end != nullptr;
  const double distance = foretells ? geometry.kind->distance(geometry, x) : 0.0;
  Approach approach(geometry, distance);
  double nearer = kSlack;
  const double change_weight = objective.weight("acceleration");
  std::span<const double> before = u_before;
  for (int t = done; t < controls.steps(); ++t) {
    const std::span<const double> u = controls.step(t);
    outlook.cost += change_weight * acceleration_cost(before, u);
    if (foretells) nearer += approach.step(before, u, step_duration);
    before = u;
  }
  outlook.cost += objective.weight("drop") * count_dropped(geometry, x, objective.value("drop", "height")) *
                  (controls.steps() - done);
  if (!foretells) return outlook;
  const double nearest = std::max(distance - nearer, 0.0);
  outlook.cost += objective.weight("goal") * nearest * nearest;
  outlook.may_succeed = nearest <= geometry.kind->distance_at_end(geometry);
  return outlook;
}

}  // namespace jostle::physics_pool
