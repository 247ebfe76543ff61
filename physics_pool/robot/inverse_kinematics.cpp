#include "physics_pool/robot/inverse_kinematics.hpp"

#include <Eigen/Cholesky>
#include <algorithm>

#include "physics_pool/robot/joint_motion.hpp"
#include "physics_pool/robot/kinematics.hpp"

namespace jostle::physics_pool {
namespace {

constexpr int kRounds = 200;
constexpr double kAccuracy = 1e-6;  // m and rad
constexpr double kDamping = 1e-4;   // squared; joints near a singularity move by no more than errors over 2·sqrt of it
constexpr double kLargest = 0.3;    // rad or m, of a joint in one round

using Twist = Eigen::Matrix<double, 6, 1>;

// Joints between the base and the tool, in order.
std::vector<int> chain_of(const RobotModel& model) {
  std::vector<int> joints;
  int link = model.hand ? model.hand->link : static_cast<int>(model.links.size()) - 1;
  for (; link >= 0; link = model.links[static_cast<std::size_t>(link)].parent) {
    const std::vector<int>& own = model.links[static_cast<std::size_t>(link)].joints;
    joints.insert(joints.end(), own.rbegin(), own.rend());
  }
  std::ranges::reverse(joints);
  return joints;
}

// How the tool moves per unit of each joint of the chain: [6][chain].
Eigen::Matrix<double, 6, Eigen::Dynamic> jacobian(const RobotModel& model, const Eigen::Isometry3d& base,
                                                  std::span<const double> q, const Eigen::Vector3d& tool) {
  std::vector<int> links;
  int link = model.hand ? model.hand->link : static_cast<int>(model.links.size()) - 1;
  for (; link >= 0; link = model.links[static_cast<std::size_t>(link)].parent) links.insert(links.begin(), link);
  Eigen::Matrix<double, 6, Eigen::Dynamic> J(6, 0);
  Eigen::Isometry3d X = base;
  for (const int l : links) {
    X = X * transform(model.links[static_cast<std::size_t>(l)].pose);
    for (const int j : model.links[static_cast<std::size_t>(l)].joints) {
      const Joint& joint = model.joints[static_cast<std::size_t>(j)];
      const Eigen::Vector3d axis = X.linear() * Eigen::Vector3d(joint.axis[0], joint.axis[1], joint.axis[2]);
      Twist column = Twist::Zero();
      if (joint.kind == JointKind::kSlide) {
        column.head<3>() = axis;
      } else {
        column << axis.cross(tool - X.translation()), axis;
      }
      J.conservativeResize(Eigen::NoChange, J.cols() + 1);
      J.rightCols<1>() = column;
      move(X, joint, q[static_cast<std::size_t>(j)]);
    }
  }
  return J;
}

Twist error(const Eigen::Isometry3d& wanted, const Eigen::Isometry3d& is) {
  const Eigen::AngleAxisd turn(wanted.linear() * is.linear().transpose());
  Twist e;
  e << wanted.translation() - is.translation(), turn.angle() * turn.axis();
  return e;
}

}  // namespace

std::optional<std::vector<double>> joints_at(const RobotModel& model, const Eigen::Isometry3d& base,
                                             const Eigen::Isometry3d& X_WT, std::span<const double> q) {
  const std::vector<int> chain = chain_of(model);
  std::vector<double> found(q.begin(), q.end());
  for (int round = 0; round < kRounds; ++round) {
    const Eigen::Isometry3d X = tool_pose(model, base, found);
    const Twist e = error(X_WT, X);
    if (e.head<3>().norm() <= kAccuracy && e.tail<3>().norm() <= kAccuracy) return found;
    const auto J = jacobian(model, base, found, X.translation());
    const Eigen::Matrix<double, 6, 6> damped =
        J * J.transpose() + std::min(kDamping, e.squaredNorm()) * Eigen::Matrix<double, 6, 6>::Identity();
    const Eigen::VectorXd change = J.transpose() * damped.ldlt().solve(e);
    const double largest = change.cwiseAbs().maxCoeff();
    const double share = largest > kLargest ? kLargest / largest : 1.0;
    for (std::size_t i = 0; i < chain.size(); ++i) {
      const auto j = static_cast<std::size_t>(chain[i]);
      const Joint& joint = model.joints[j];
      found[j] = std::clamp(found[j] + share * change[static_cast<Eigen::Index>(i)], joint.low, joint.high);
    }
  }
  return {};
}

}  // namespace jostle::physics_pool
