#include "robot_bridge/ur/kinematics.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace jostle::robot_bridge::ur {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;
constexpr double kStraight = 1e-7;   // rad, an angle that an arc cosine cannot tell from none
constexpr double kOverreach = 1e-9;  // how far beyond 1 rounding may take a cosine

Isometry3d link(const DhRow& row, double q) {
  return Eigen::Translation3d(0, 0, row.d) * Eigen::AngleAxisd(q + row.theta, Vector3d::UnitZ()) *
         Eigen::Translation3d(row.a, 0, 0) * Eigen::AngleAxisd(row.alpha, Vector3d::UnitX());
}

// In (-pi, pi].
double wrapped(double angle) {
  const double turned = std::remainder(angle, 2 * kPi);
  return turned <= -kPi ? turned + 2 * kPi : turned;
}

// The two angles of a cosine; one where they are the same, none where it is no cosine.
std::vector<double> arccosines(double cosine) {
  if (std::abs(cosine) > 1 + kOverreach || std::isnan(cosine)) return {};
  const double angle = std::acos(std::clamp(cosine, -1.0, 1.0));
  if (angle < kStraight) return {0.0};
  return {angle, -angle};
}

// The error of a pose as a small motion in the base frame: translation, m, and rotation vector, rad.
Eigen::Matrix<double, 6, 1> error(const Isometry3d& wanted, const Isometry3d& got) {
  const Eigen::AngleAxisd turn(wanted.linear() * got.linear().transpose());
  Eigen::Matrix<double, 6, 1> e;
  e << wanted.translation() - got.translation(), turn.angle() * turn.axis();
  return e;
}

// Newton's steps from a solution in closed form, which loses half of the digits where an arc cosine begins.
Joints polished(const Dh& dh, const Isometry3d& X_BT, Joints q) {
  constexpr int kSteps = 3;
  double residual = error(X_BT, flange_pose(dh, q)).norm();
  for (int i = 0; i < kSteps && residual > 1e-14; ++i) {
    const Eigen::Matrix<double, 6, 1> e = error(X_BT, flange_pose(dh, q));
    const Eigen::Matrix<double, 6, 1> step = jacobian(dh, q).completeOrthogonalDecomposition().solve(e);
    Joints next = q;
    for (std::size_t j = 0; j < next.size(); ++j) next[j] += step[static_cast<Eigen::Index>(j)];
    const double better = error(X_BT, flange_pose(dh, next)).norm();
    if (!(better < residual)) break;
    q = next;
    residual = better;
  }
  for (double& angle : q) angle = wrapped(angle);
  return q;
}

// Joints 2 to 4, for joints 1, 5 and 6 that are known: an arm of two links in the plane of frame 1.
void add_elbows(const Dh& dh, const Isometry3d& X_BT, double q1, double q5, double q6, std::vector<Joints>& solutions) {
  const auto& rows = dh.rows;
  const Isometry3d X_14 =
      link(rows[0], q1).inverse() * X_BT * link(rows[5], q6).inverse() * link(rows[4], q5).inverse();
  const double x = X_14.translation().x(), y = X_14.translation().y();
  const double upper = rows[1].a, fore = rows[2].a;
  for (const double q3 : arccosines((x * x + y * y - upper * upper - fore * fore) / (2 * upper * fore))) {
    const double q2 = std::atan2(y, x) - std::atan2(fore * std::sin(q3), upper + fore * std::cos(q3));
    const Vector3d x_4 = X_14.linear().col(0);
    const double q4 = std::atan2(x_4.y(), x_4.x()) - q2 - q3;
    solutions.push_back(polished(dh, X_BT, {q1, q2, q3, q4, q5, q6}));
  }
}

}  // namespace

const Dh& Dh::ur5() {
  static const Dh dh{{{{0.0, 0.089159, kPi / 2},
                       {-0.425, 0.0, 0.0},
                       {-0.39225, 0.0, 0.0},
                       {0.0, 0.10915, kPi / 2},
                       {0.0, 0.09465, -kPi / 2},
                       {0.0, 0.0823, 0.0}}}};
  return dh;
}

Isometry3d flange_pose(const Dh& dh, const Joints& q) {
  Isometry3d X = Isometry3d::Identity();
  for (std::size_t i = 0; i < q.size(); ++i) X = X * link(dh.rows[i], q[i]);
  return X;
}

Eigen::Matrix<double, 6, 6> jacobian(const Dh& dh, const Joints& q) {
  std::array<Vector3d, 6> axes, origins;
  Isometry3d X = Isometry3d::Identity();
  for (std::size_t i = 0; i < q.size(); ++i) {
    axes[i] = X.linear().col(2);
    origins[i] = X.translation();
    X = X * link(dh.rows[i], q[i]);
  }
  Eigen::Matrix<double, 6, 6> J;
  for (std::size_t i = 0; i < q.size(); ++i) {
    J.col(static_cast<Eigen::Index>(i)) << axes[i].cross(X.translation() - origins[i]), axes[i];
  }
  return J;
}

std::vector<Joints> inverse(const Dh& dh, const Isometry3d& X_BT, double free_wrist) {
  const double d4 = dh.rows[3].d, d6 = dh.rows[5].d;
  const Vector3d p = X_BT.translation();
  const Eigen::Matrix3d R = X_BT.linear();
  const Vector3d wrist = p - d6 * R.col(2);  // the origin of frame 5
  std::vector<Joints> solutions;
  // Frame 4 is d4 beside the plane in which joints 2 to 4 move, and so is the wrist's centre.
  for (const double shoulder : arccosines(d4 / std::hypot(wrist.x(), wrist.y()))) {
    const double q1 = wrapped(std::atan2(wrist.y(), wrist.x()) + shoulder + kPi / 2);
    const double s1 = std::sin(q1), c1 = std::cos(q1);
    for (const double q5 : arccosines((p.x() * s1 - p.y() * c1 - d4) / d6)) {
      const double s5 = std::sin(q5);
      if (std::abs(s5) < kStraight) {
        add_elbows(dh, X_BT, q1, q5, free_wrist, solutions);
        continue;
      }
      const double q6 = std::atan2((-R(0, 1) * s1 + R(1, 1) * c1) / s5, (R(0, 0) * s1 - R(1, 0) * c1) / s5);
      add_elbows(dh, X_BT, q1, q5, q6, solutions);
    }
  }
  return solutions;
}

std::optional<Joints> nearest(const std::vector<Joints>& solutions, const Joints& seed, double limit) {
  std::optional<Joints> best;
  double least = std::numeric_limits<double>::infinity();
  for (Joints q : solutions) {
    double largest = 0.0;
    for (std::size_t j = 0; j < q.size(); ++j) {
      const double turned = q[j] + 2 * kPi * std::round((seed[j] - q[j]) / (2 * kPi));
      if (std::abs(turned) <= limit) q[j] = turned;
      largest = std::max(largest, std::abs(q[j] - seed[j]));
    }
    if (largest >= least) continue;
    least = largest;
    best = q;
  }
  return best;
}

}  // namespace jostle::robot_bridge::ur
