#include "physics_pool/robot/kinematics.hpp"

#include <algorithm>
#include <cmath>

#include "physics_pool/robot/joint_motion.hpp"

namespace jostle::physics_pool {

void move(Eigen::Isometry3d& X, const Joint& joint, double value) {
  const Eigen::Vector3d axis(joint.axis[0], joint.axis[1], joint.axis[2]);
  if (joint.kind == JointKind::kSlide) {
    X.translate(Eigen::Vector3d(axis * value));
  } else {
    X.rotate(Eigen::AngleAxisd(value, axis));
  }
}

Eigen::Isometry3d link_pose(const RobotModel& model, const Eigen::Isometry3d& base, std::span<const double> q,
                            int link) {
  // Parents come first and chains are short: no list of them is kept.
  const Link& l = model.links[static_cast<std::size_t>(link)];
  Eigen::Isometry3d X = (l.parent < 0 ? base : link_pose(model, base, q, l.parent)) * transform(l.pose);
  for (const int j : l.joints) {
    const auto place = static_cast<std::size_t>(j);
    move(X, model.joints[place], q[place]);
  }
  return X;
}

Eigen::Isometry3d tool_pose(const RobotModel& model, const Eigen::Isometry3d& base, std::span<const double> q) {
  if (!model.hand) return link_pose(model, base, q, static_cast<int>(model.links.size()) - 1);
  return link_pose(model, base, q, model.hand->link) * transform(model.hand->pose);
}

namespace {

double extent(const RobotGeom& geom) {
  switch (geom.shape) {
    case GeomShape::kBox:
      return std::hypot(geom.size[0], geom.size[1], geom.size[2]) / 2;
    case GeomShape::kCylinder:
      return std::hypot(geom.radius, geom.height / 2);
    case GeomShape::kSphere:
      return geom.radius;
    case GeomShape::kMesh:
      break;
  }
  double most = 0.0;
  for (std::size_t i = 0; i + 2 < geom.vertices.size(); i += 3) {
    most = std::max(most, std::hypot(geom.vertices[i], geom.vertices[i + 1], geom.vertices[i + 2]));
  }
  return most;
}

double length(const Pose& pose) { return std::hypot(pose.position[0], pose.position[1], pose.position[2]); }

// From the link's origin to the farthest point of it and of what hangs on it, m.
double reach(const RobotModel& model, int link) {
  const Link& own = model.links[static_cast<std::size_t>(link)];
  double most = model.hand && model.hand->link == link ? length(model.hand->pose) : 0.0;
  for (const RobotGeom& geom : own.geoms) most = std::max(most, length(geom.pose) + extent(geom));
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const Link& child = model.links[i];
    if (child.parent != link) continue;
    double way = length(child.pose) + reach(model, static_cast<int>(i));
    for (const int j : child.joints) {
      const Joint& joint = model.joints[static_cast<std::size_t>(j)];
      if (joint.kind == JointKind::kSlide) way += std::max(std::abs(joint.low), std::abs(joint.high));
    }
    most = std::max(most, way);
  }
  return most;
}

}  // namespace

std::vector<double> axis_reaches(const RobotModel& model) {
  std::vector<double> of_joint(model.joints.size(), 1.0);
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    for (const int j : model.links[i].joints) {
      const auto joint = static_cast<std::size_t>(j);
      if (model.joints[joint].kind == JointKind::kHinge) of_joint[joint] = reach(model, static_cast<int>(i));
    }
  }
  std::vector<double> reaches;
  for (const Axis& axis : model.axes) {
    double sum = 0.0;
    for (const auto& [joint, factor] : axis.joints) sum += std::abs(factor) * of_joint[static_cast<std::size_t>(joint)];
    reaches.push_back(sum);
  }
  return reaches;
}

double control_norm(const RobotModel& model, std::span<const double> u) {
  constexpr double kLever = 0.1;  // m
  double sum = 0.0;
  for (std::size_t i = 0; i < u.size(); ++i) {
    const auto joint = static_cast<std::size_t>(model.axes[i].joints[0].first);
    const double speed = u[i] * (model.joints[joint].kind == JointKind::kHinge ? kLever : 1.0);
    sum += speed * speed;
  }
  return std::sqrt(sum);
}

}  // namespace jostle::physics_pool
