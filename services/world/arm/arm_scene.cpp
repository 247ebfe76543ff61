#include "services/world/arm/arm_scene.hpp"

#include <fmt/format.h>

#include <utility>

#include "physics_pool/robot/robot_yaml.hpp"

namespace jostle::world {

using robot_bridge::planar::Mounting;

Result<std::vector<double>> arm_joints(std::span<const double> gripper, const Mounting& mounting) {
  const robot_bridge::planar::PlanarPose pose{gripper[kHandX], gripper[kHandY], gripper[kHandRotation]};
  const auto joints = robot_bridge::planar::joints_at(mounting, robot_bridge::ur::Dh::ur5(), pose);
  if (!joints) {
    return Error{
        Code::kInvalidArgument,
        fmt::format("robot.start: got a hand at ({:.3f}, {:.3f}) m, wanted one that a UR5 at ({:.2f}, {:.2f}) m "
                    "reaches: 0.15 to 1 m away",
                    pose.x, pose.y, mounting.base.translation().x(), mounting.base.translation().y())};
  }
  std::vector<double> q(joints->begin(), joints->end());
  q.insert(q.end(), {gripper[kLeftFinger], gripper[kRightFinger]});
  return q;
}

Result<physics_pool::Scene> with_arm(const physics_pool::Scene& scene, const Mounting& mounting) {
  auto hand_result = physics_pool::builtin_robot("planar_gripper");
  if (!hand_result) return hand_result.error();
  if (scene.robot.model != *hand_result) {
    return Error{
        Code::kInvalidArgument,
        fmt::format("robot.model: got '{}', wanted planar_gripper: an arm moves its hand", scene.robot.model.name)};
  }
  auto arm_result = physics_pool::builtin_robot("ur5_2f85");
  if (!arm_result) return arm_result.error();
  auto joints_result = arm_joints(scene.robot.q, mounting);
  if (!joints_result) return joints_result.error();
  physics_pool::Scene result = scene;
  result.robot.model = std::move(arm_result).value();
  result.robot.q = std::move(joints_result).value();
  const Eigen::Vector3d p = mounting.base.translation();
  const Eigen::Quaterniond R(mounting.base.linear());
  result.robot.base = {.position = {p.x(), p.y(), p.z()}, .orientation = {R.w(), R.x(), R.y(), R.z()}};
  return result;
}

}  // namespace jostle::world
