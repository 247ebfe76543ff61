#include "planners/adaptive/action_sequences.hpp"

#include <algorithm>
#include <cmath>

namespace jostle::planners {
namespace {

using physics_pool::Shape;
using physics_pool::TaskGeometry;

// How far ahead of the tool's origin the target's centre is when they touch, m.
double contact_distance(const TaskGeometry& geometry, const State& x) {
  const physics_pool::SceneObject& target = geometry.target;
  const bool is_box = target.shape == Shape::kBox;
  // The sides of a box are nearer than its corners; which of them is met, the optimizer finds out.
  const double half = is_box ? (target.size[0] + target.size[1]) / 4 : target.radius;
  if (!geometry.robot.hand) return geometry.disc_radius + half;
  const physics_pool::Hand& hand = *geometry.robot.hand;
  const std::span<const double> q = geometry.view(x).joints();
  const double gap =
      std::min(q[static_cast<std::size_t>(hand.left)], q[static_cast<std::size_t>(hand.right)]);  // to each side
  if (half < gap) return half;
  return hand.finger_length + (is_box ? half : std::sqrt(half * half - gap * gap));
}

}  // namespace

std::vector<int> action_counts(int n_min, int n_max, int sequences) {
  std::vector<int> counts;
  for (int k = 0; k < sequences; ++k) {
    const int gaps = std::max(sequences - 1, 1);
    counts.push_back(((n_max - n_min) * k + gaps - 1) / gaps + n_min);  // rounded up
  }
  return counts;
}

StraightWay straight_way(const TaskGeometry& geometry, const State& x) {
  const Eigen::Isometry3d X_WT = physics_pool::tool_pose(geometry, x);
  const double* target = geometry.view(x).target().position();
  const double tool_x = X_WT.translation().x(), tool_y = X_WT.translation().y();
  const double to_target = std::hypot(target[0] - tool_x, target[1] - tool_y);
  const bool pushes = geometry.kind->has_goal;
  const double to_x = pushes ? geometry.task.goal.x : target[0], to_y = pushes ? geometry.task.goal.y : target[1];
  const double far = std::hypot(to_x - tool_x, to_y - tool_y);
  StraightWay way;
  if (far > 0) {
    way.dx = (to_x - tool_x) / far;
    way.dy = (to_y - tool_y) / far;
  }
  if (pushes) {
    const double left = std::hypot(to_x - target[0], to_y - target[1]);
    way.length = left + std::max(to_target - contact_distance(geometry, x), 0.0);
  } else {
    way.length = std::max(to_target - (geometry.robot.hand ? geometry.robot.hand->depth : 0.0), 0.0);
  }
  return way;
}

std::vector<ControlSequence> action_sequences(const TaskGeometry& geometry, const State& x, int n_min, int n_max,
                                              int sequences, double step_duration, const std::vector<double>& limit) {
  const StraightWay way = straight_way(geometry, x);
  std::vector<ControlSequence> result;
  for (const int steps : action_counts(n_min, n_max, sequences)) {
    std::vector<double> u(static_cast<std::size_t>(geometry.layout.nu), 0.0);
    const auto ax = static_cast<std::size_t>(geometry.planar->x), ay = static_cast<std::size_t>(geometry.planar->y);
    u[ax] = way.dx * way.length / (steps * step_duration);
    u[ay] = way.dy * way.length / (steps * step_duration);
    // Along the way, not off it.
    const double excess = std::max({std::abs(u[ax]) / limit[ax], std::abs(u[ay]) / limit[ay], 1.0});
    u[ax] /= excess;
    u[ay] /= excess;
    ControlSequence& controls = result.emplace_back(ControlSequence{.nu = geometry.layout.nu});
    for (int t = 0; t < steps; ++t) controls.append(u);
  }
  return result;
}

}  // namespace jostle::planners
