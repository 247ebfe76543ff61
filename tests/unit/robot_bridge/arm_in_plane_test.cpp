// The planner's hand on an arm: in its plane, on its path, never faster than the arm.

#include "robot_bridge/planar/arm_in_plane.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <random>

namespace jostle::robot_bridge::planar {
namespace {

using ::testing::HasSubstr;
using ur::Dh;

constexpr double kCycle = 0.008;  // s
constexpr double kDegree = std::numbers::pi / 180;

class OverTheTable : public ::testing::Test {
 protected:
  // Joints that follow speeds exactly.
  void integrate(const Joints& speeds) {
    for (std::size_t j = 0; j < q.size(); ++j) q[j] += speeds[j] * kCycle;
  }

  const Mounting mounting;
  const Dh& dh = Dh::ur5();
  Joints q = *joints_at(mounting, dh, {-0.3, 0.0, 0.0});
  ArmInPlane sut{mounting, dh};
};

TEST_F(OverTheTable, JointsAtAPoseBringTheHandThere) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> x(-0.35, 0.1), y(-0.25, 0.25), turn(-1.0, 1.0);
  for (int i = 0; i < 200; ++i) {
    const PlanarPose pose{x(random), y(random), turn(random)};
    const auto joints = joints_at(mounting, dh, pose);
    ASSERT_TRUE(joints) << pose.x << " " << pose.y << " " << pose.rotation;
    const PlanarPose got = planar_pose(mounting, dh, *joints);
    EXPECT_NEAR(got.x, pose.x, 1e-9);
    EXPECT_NEAR(got.y, pose.y, 1e-9);
    EXPECT_NEAR(got.rotation, pose.rotation, 1e-9);
    const Deviation off = deviation(mounting, dh, *joints);
    EXPECT_NEAR(off.height, 0.0, 1e-9);
    EXPECT_NEAR(off.tilt, 0.0, 1e-7);
  }
}

// Seeded walks over the table, with all velocities that planners give.
TEST_F(OverTheTable, TheHandStaysWithinAMillimetreAndATenthOfADegreeOfItsPlane) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> speed(-0.2, 0.2), turn(-0.6, 0.6);
  double highest = 0.0, steepest = 0.0;
  int followed = 0;
  for (int walk = 0; walk < 20; ++walk) {
    q = *joints_at(mounting, dh, {-0.2, 0.0, 0.0});
    ASSERT_TRUE(sut.begin(q));
    for (int action = 0; action < 8; ++action) {
      const PlanarPose at = planar_pose(mounting, dh, q);
      // Home again from the borders of what the table needs.
      const double home_x = std::abs(at.x + 0.1) > 0.2 ? -0.5 * (at.x + 0.1) : 0.0,
                   home_y = std::abs(at.y) > 0.2 ? -at.y : 0.0;
      const PlanarVelocity v{speed(random) + home_x, speed(random) + home_y,
                             std::abs(at.rotation) > 1 ? -at.rotation : turn(random)};
      for (int i = 0; i < 125; ++i) {
        const auto speeds = sut.follow(v, q, kCycle);
        if (!speeds) break;
        ++followed;
        integrate(*speeds);
        const Deviation off = deviation(mounting, dh, q);
        highest = std::max(highest, std::abs(off.height));
        steepest = std::max(steepest, off.tilt);
      }
      ASSERT_TRUE(sut.begin(q));
    }
  }
  EXPECT_GT(followed, 15'000);
  EXPECT_LT(highest, 1e-3);
  EXPECT_LT(steepest, 0.1 * kDegree);
}

TEST_F(OverTheTable, TooFastAPathIsFollowedMoreSlowly) {
  ASSERT_TRUE(sut.begin(q));
  const PlanarPose start = sut.reference();
  for (int i = 0; i < 20; ++i) {
    const auto speeds = sut.follow({5.0, 2.5, 0.0}, q, kCycle);
    if (!speeds) break;
    for (const double speed : *speeds) EXPECT_LE(std::abs(speed), 3.0);
    integrate(*speeds);
    const PlanarPose now = sut.reference();
    EXPECT_NEAR(now.y - start.y, 0.5 * (now.x - start.x), 1e-9);
  }
  EXPECT_LT(sut.reference().x - start.x, 5.0 * 20 * kCycle);
  EXPECT_GT(sut.reference().x - start.x, 0.02);
}

TEST_F(OverTheTable, APathOutOfReachEndsBeforeTheArmJumps) {
  ASSERT_TRUE(sut.begin(q));
  for (int i = 0; i < 2000; ++i) {
    const auto speeds = sut.follow({0.3, 0.0, 0.0}, q, kCycle);
    if (!speeds) {
      EXPECT_THAT(speeds.error().message, HasSubstr("leaves the arm's reach"));
      EXPECT_GT(planar_pose(mounting, dh, q).x, 0.1);
      return;
    }
    integrate(*speeds);
  }
  FAIL() << "it went on for " << 2000 * kCycle << " s";
}

TEST_F(OverTheTable, AHandOutOfItsPlaneDoesNotBegin) {
  Mounting higher = mounting;
  higher.height += 0.05;
  const auto ok = sut.begin(*joints_at(higher, dh, {-0.3, 0.0, 0.0}));
  ASSERT_FALSE(ok);
  EXPECT_THAT(ok.error().message, HasSubstr("50 mm above"));
}

}  // namespace
}  // namespace jostle::robot_bridge::planar
