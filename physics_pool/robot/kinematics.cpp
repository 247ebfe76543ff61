#include "physics_pool/robot/kinematics.hpp"

namespace jostle::physics_pool {

Eigen::Isometry3d link_pose(const RobotModel& model, const Eigen::Isometry3d& base, std::span<const double> q,
                            int link) {
  // Parents come first and chains are short: no list of them is kept.
  const Link& l = model.links[static_cast<std::size_t>(link)];
  Eigen::Isometry3d X = (l.parent < 0 ? base : link_pose(model, base, q, l.parent)) * transform(l.pose);
  for (const int j : l.joints) {
    const Joint& joint = model.joints[static_cast<std::size_t>(j)];
    const Eigen::Vector3d axis(joint.axis[0], joint.axis[1], joint.axis[2]);
    const double value = q[static_cast<std::size_t>(j)];
    if (joint.kind == JointKind::kSlide) {
      X.translate(Eigen::Vector3d(axis * value));
    } else {
      X.rotate(Eigen::AngleAxisd(value, axis));
    }
  }
  return X;
}

Eigen::Isometry3d tool_pose(const RobotModel& model, const Eigen::Isometry3d& base, std::span<const double> q) {
  if (!model.hand) return link_pose(model, base, q, static_cast<int>(model.links.size()) - 1);
  return link_pose(model, base, q, model.hand->link) * transform(model.hand->pose);
}

}  // namespace jostle::physics_pool
