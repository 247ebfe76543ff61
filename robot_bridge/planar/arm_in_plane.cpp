#include "robot_bridge/planar/arm_in_plane.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace jostle::robot_bridge::planar {
namespace {

using Eigen::Isometry3d;

constexpr double kTurn = 2 * std::numbers::pi;
constexpr double kFarthest = kTurn;      // rad: a joint's range either way
constexpr double kElbowStraight = 0.05;  // rad from straight: beyond, speeds grow without end
constexpr double kJump = 0.5;            // rad: the next solution is on another branch

Isometry3d hand_pose(const Mounting& mounting, const ur::Dh& dh, const Joints& q) {
  return mounting.base * ur::flange_pose(dh, q) * mounting.hand;
}

// Height of the elbow's and the first wrist's axes, the lower of both.
double clearance(const ur::Dh& dh, const Joints& q) {
  ur::Dh part = dh;
  for (std::size_t row = 4; row < 6; ++row) part.rows[row] = {};
  const double wrist = ur::flange_pose(part, {q[0], q[1], q[2], q[3], 0, 0}).translation().z();
  for (std::size_t row = 2; row < 4; ++row) part.rows[row] = {};
  const double elbow = ur::flange_pose(part, {q[0], q[1], 0, 0, 0, 0}).translation().z();
  return std::min(wrist, elbow);
}

}  // namespace

Isometry3d flange_at(const Mounting& mounting, const PlanarPose& pose) {
  const Isometry3d X_WG = Eigen::Translation3d(pose.x, pose.y, mounting.height) *
                          Isometry3d(Eigen::AngleAxisd(pose.rotation, Eigen::Vector3d::UnitZ()));
  return mounting.base.inverse() * X_WG * mounting.hand.inverse();
}

PlanarPose planar_pose(const Mounting& mounting, const ur::Dh& dh, const Joints& q, double near) {
  const Isometry3d X_WG = hand_pose(mounting, dh, q);
  const double rotation = std::atan2(X_WG.linear()(1, 0), X_WG.linear()(0, 0));
  return {X_WG.translation().x(), X_WG.translation().y(), near + std::remainder(rotation - near, kTurn)};
}

Deviation deviation(const Mounting& mounting, const ur::Dh& dh, const Joints& q) {
  const Isometry3d X_WG = hand_pose(mounting, dh, q);
  return {.height = X_WG.translation().z() - mounting.height,
          .tilt = std::acos(std::clamp(X_WG.linear()(2, 2), -1.0, 1.0))};
}

std::optional<Joints> joints_at(const Mounting& mounting, const ur::Dh& dh, const PlanarPose& pose) {
  std::optional<Joints> best;
  for (const Joints& q : ur::inverse(dh, flange_at(mounting, pose))) {
    if (!best || clearance(dh, q) > clearance(dh, *best)) best = q;
  }
  return best;
}

Result<void> ArmInPlane::begin(const Joints& measured) {
  const Deviation off = deviation(mounting_, dh_, measured);
  pose_ = planar_pose(mounting_, dh_, measured, pose_.rotation);
  if (std::abs(off.height) > kMostHeight || off.tilt > kMostTilt) {
    return Error{
        Code::kInvalidArgument,
        fmt::format("the hand is {:.0f} mm above and {:.1f} degrees out of its plane, wanted at most {:.0f} mm "
                    "and {:.1f} degrees: move it to {:.0f} mm above the surface, level",
                    1e3 * off.height, off.tilt * 360 / kTurn, 1e3 * kMostHeight, kMostTilt * 360 / kTurn,
                    1e3 * mounting_.height)};
  }
  const auto q = ur::nearest(ur::inverse(dh_, flange_at(mounting_, pose_)), measured, kFarthest);
  if (!q) {
    return Error{Code::kInvalidArgument,
                 fmt::format("the hand at ({:.3f}, {:.3f}) m is out of the arm's reach", pose_.x, pose_.y)};
  }
  q_ = *q;
  return {};
}

Result<Joints> ArmInPlane::follow(const PlanarVelocity& v, const Joints& measured, double dt) {
  const PlanarPose next{pose_.x + v.x * dt, pose_.y + v.y * dt, pose_.rotation + v.rotation * dt};
  const auto q_next = ur::nearest(ur::inverse(dh_, flange_at(mounting_, next)), q_, kFarthest);
  const auto jumps = [&](const Joints& q) {
    for (std::size_t j = 0; j < q.size(); ++j) {
      if (std::abs(q[j] - q_[j]) > kJump) return true;
    }
    return false;
  };
  if (!q_next || jumps(*q_next) || std::abs((*q_next)[2]) < kElbowStraight) {
    return Error{Code::kInvalidArgument,
                 fmt::format("the path leaves the arm's reach at ({:.3f}, {:.3f}) m, {:.1f} degrees", next.x, next.y,
                             next.rotation * 360 / kTurn)};
  }
  double fastest = 0.0;
  for (std::size_t j = 0; j < q_.size(); ++j) fastest = std::max(fastest, std::abs((*q_next)[j] - q_[j]) / dt);
  if (fastest > kFastest) {
    // A part of the step, on the same path.
    const double share = kFastest / fastest;
    pose_ = {pose_.x + share * v.x * dt, pose_.y + share * v.y * dt, pose_.rotation + share * v.rotation * dt};
  } else {
    pose_ = next;
  }
  const Joints before = q_;
  const auto q_now =
      fastest > kFastest ? ur::nearest(ur::inverse(dh_, flange_at(mounting_, pose_)), q_, kFarthest) : q_next;
  if (q_now) q_ = *q_now;
  Joints speeds;
  for (std::size_t j = 0; j < q_.size(); ++j) {
    const double wanted = (q_[j] - before[j]) / dt + kStiffness * (before[j] - measured[j]);
    speeds[j] = std::clamp(wanted, -3.0, 3.0);
  }
  return speeds;
}

}  // namespace jostle::robot_bridge::planar
