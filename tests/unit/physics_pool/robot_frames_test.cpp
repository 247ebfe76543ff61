// Robots as frames with a joint each, and as URDF.

#include <gmock/gmock.h>
#include <urdf_parser/urdf_parser.h>

#include <algorithm>

#include "physics_pool/robot/kinematics.hpp"
#include "physics_pool/robot/robot_frames.hpp"
#include "physics_pool/robot/robot_yaml.hpp"
#include "tests/support/arms.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;
using testing::ElementsAre;

const Pose kBase{.position = {-0.4, 0.1, 0.2}, .orientation = turned_about_z(0.7)};

std::vector<std::string> names(const std::vector<RobotFrame>& frames) {
  std::vector<std::string> result;
  for (const RobotFrame& frame : frames) result.push_back(frame.name);
  return result;
}

// Somewhere within all limits, no joint at 0.
std::vector<double> somewhere(const RobotModel& model) {
  std::vector<double> q;
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    const Joint& joint = model.joints[j];
    q.push_back(std::clamp(0.3 + 0.1 * static_cast<double>(j), joint.low, joint.high));
  }
  return q;
}

class EveryRobot : public testing::TestWithParam<std::string> {
 protected:
  const RobotModel model = GetParam() == "seven_axis" ? seven_axis() : builtin_robot(GetParam()).value();
  const std::vector<RobotFrame> frames = robot_frames(model, kBase, {"world"});
  const std::vector<double> q = somewhere(model);
};

TEST_P(EveryRobot, HasItsLinksWhereItsKinematicsPutsThem) {
  std::vector<Eigen::Isometry3d> X_WF;
  std::size_t links = 0;
  for (const RobotFrame& frame : frames) {
    const auto X_PF = frame_pose(model, frame, q);
    X_WF.push_back(frame.parent < 0 ? X_PF : X_WF[static_cast<std::size_t>(frame.parent)] * X_PF);
    if (frame.link < 0) continue;
    ++links;
    EXPECT_TRUE(X_WF.back().isApprox(link_pose(model, transform(kBase), q, frame.link), 1e-12)) << frame.name;
  }
  EXPECT_EQ(links, model.links.size());
}

// urdfdom, and its frames put together by hand.
TEST_P(EveryRobot, HasThemThereInItsUrdfToo) {
  const auto urdf = urdf::parseURDF(to_urdf(model, frames));
  ASSERT_TRUE(urdf);
  EXPECT_EQ(urdf->getName(), model.name);
  for (const RobotFrame& frame : frames) {
    const auto link = urdf->getLink(frame.name);
    ASSERT_TRUE(link) << frame.name;
    if (frame.link >= 0) {
      EXPECT_EQ(link->visual_array.size(), model.links[static_cast<std::size_t>(frame.link)].geoms.size());
    }
    if (frame.parent < 0) continue;
    const auto& joint = *link->parent_joint;
    const auto& [p, R] = joint.parent_to_joint_origin_transform;
    Eigen::Isometry3d X = transform({.position = {p.x, p.y, p.z}, .orientation = {R.w, R.x, R.y, R.z}});
    EXPECT_EQ(joint.parent_link_name, frames[static_cast<std::size_t>(frame.parent)].name);
    if (frame.joint >= 0) {
      const Joint& moved = model.joints[static_cast<std::size_t>(frame.joint)];
      EXPECT_EQ(joint.name, moved.name);
      const Eigen::Vector3d axis(joint.axis.x, joint.axis.y, joint.axis.z);
      const double value = q[static_cast<std::size_t>(frame.joint)];
      if (joint.type == urdf::Joint::PRISMATIC) {
        X.translate(Eigen::Vector3d(axis * value));
      } else {
        X.rotate(Eigen::AngleAxisd(value, axis));
      }
      EXPECT_GT(joint.limits->velocity, 0) << joint.name;
    }
    EXPECT_TRUE(X.isApprox(frame_pose(model, frame, q), 1e-9)) << frame.name;
  }
}

INSTANTIATE_TEST_SUITE_P(OfRobotFrames, EveryRobot,
                         testing::Values("planar_gripper", "pusher", "ur5_2f85", "seven_axis"),
                         [](const auto& robot) { return robot.param; });

TEST(RobotFrames, StandBetweenJointsOfOneLink) {
  const auto frames = robot_frames(builtin_robot("planar_gripper").value(), {}, {});

  EXPECT_THAT(names(frames),
              ElementsAre("robot_base", "gripper_x", "gripper_y", "gripper", "finger_left", "finger_right"));
}

TEST(RobotFrames, AreCalledAsNothingElseIs) {
  RobotModel model = seven_axis();
  model.links[0].name = "world";  // as many URDF files call their root

  EXPECT_THAT(names(robot_frames(model, {}, {"world", "palm"})),
              testing::IsSupersetOf({"world_", "palm_", "shoulder"}));
}

// What the text says of masses is what the engine makes of them: read back, a robot weighs the same.
TEST(ToUrdf, KeepsInertiasThatFollowFromGeoms) {
  const RobotModel model = builtin_robot("ur5_2f85").value();

  const auto read = parse_urdf(to_urdf(model, robot_frames(model, {}, {})), "arm.urdf", {});

  ASSERT_TRUE(read) << read.error().message;
  const auto finger = std::ranges::find(read->links, "finger_left", &Link::name);
  ASSERT_TRUE(finger->inertia);
  EXPECT_DOUBLE_EQ(finger->inertia->mass, 0.1);
  // A box of 0.07 x 0.015 x 0.022 m, its middle 0.035 m ahead.
  EXPECT_DOUBLE_EQ(finger->inertia->pose.position[0], 0.035);
  EXPECT_NEAR(finger->inertia->moments[0], 0.1 / 12 * (0.015 * 0.015 + 0.022 * 0.022), 1e-15);
  EXPECT_NEAR(finger->inertia->moments[2], 0.1 / 12 * (0.07 * 0.07 + 0.015 * 0.015), 1e-15);
  for (std::size_t j = 0; j < model.joints.size(); ++j) {
    EXPECT_EQ(read->joints[j].name, model.joints[j].name);
    EXPECT_EQ(read->joints[j].low, model.joints[j].low);
    EXPECT_EQ(read->joints[j].high, model.joints[j].high);
  }
}

}  // namespace
}  // namespace jostle::physics_pool
