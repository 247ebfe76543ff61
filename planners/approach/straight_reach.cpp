#include "planners/approach/straight_reach.hpp"

#include <algorithm>
#include <cmath>

#include "physics_pool/robot/inverse_kinematics.hpp"

namespace jostle::planners {

ControlSequence follow(const physics_pool::TaskGeometry& geometry, std::span<const double> q,
                       std::span<const Eigen::Isometry3d> poses, double step_duration) {
  ControlSequence controls{.nu = geometry.layout.nu};
  std::vector<double> joints(q.begin(), q.end());
  for (const Eigen::Isometry3d& pose : poses) {
    auto next = physics_pool::joints_at(geometry.robot, geometry.base, pose, joints);
    if (!next) next = joints;
    for (const physics_pool::Axis& axis : geometry.robot.axes) {
      const auto& [joint, factor] = axis.joints.front();
      const auto j = static_cast<std::size_t>(joint);
      const double speed = ((*next)[j] - joints[j]) / (factor * step_duration);
      controls.values.push_back(std::clamp(speed, -axis.limit, axis.limit));
    }
    joints = *std::move(next);
  }
  return controls;
}

ControlSequence straight_reach(const physics_pool::TaskGeometry& geometry, const State& x, int steps,
                               double step_duration) {
  const Eigen::Isometry3d from = tool_pose(geometry, x);
  const double* target = geometry.view(x).target().position();
  const Eigen::Vector3d way(target[0] - from.translation().x(), target[1] - from.translation().y(), 0);
  const double distance = way.norm();
  const double share = distance > 0 ? (distance - geometry.robot.hand->depth) / distance : 0.0;
  std::vector<Eigen::Isometry3d> poses;
  for (int t = 1; t <= steps; ++t) {
    poses.push_back(from);
    poses.back().translation() += share * t / steps * way;
  }
  return follow(geometry, geometry.view(x).joints(), poses, step_duration);
}

}  // namespace jostle::planners
