#pragma once
/// \file
/// Poses as Eigen's transforms. They are not in pose.hpp, because Eigen's headers are large.

#include <Eigen/Geometry>

#include "idl/types/pose.hpp"

namespace jostle {

inline Eigen::Isometry3d transform(const Pose& pose) {
  const auto& [p, q] = pose;
  Eigen::Isometry3d X = Eigen::Isometry3d::Identity();
  X.linear() = Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
  X.translation() = Eigen::Vector3d(p[0], p[1], p[2]);
  return X;
}

inline Pose pose_of(const Eigen::Isometry3d& X) {
  const Eigen::Quaterniond q(X.linear());
  return {.position = {X.translation().x(), X.translation().y(), X.translation().z()},
          .orientation = {q.w(), q.x(), q.y(), q.z()}};
}

}  // namespace jostle
