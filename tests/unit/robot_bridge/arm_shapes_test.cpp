// The room that an arm takes.

#include "robot_bridge/ur/arm_shapes.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <random>

#include "robot_bridge/planar/arm_in_plane.hpp"

namespace jostle::robot_bridge::ur {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

const planar::Mounting kMounting;

// Joints that hold the hand level at (x, y), m, as the bridge does.
Joints level_at(double x, double y, double rotation = 0.0) {
  return planar::joints_at(kMounting, Dh::ur5(), {x, y, rotation}).value();
}

TEST(ArmShapes, WristTwoEndsWhereTheFlangeBegins) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> angle(-3.0, 3.0);
  for (int i = 0; i < 100; ++i) {
    Joints q;
    for (double& joint : q) joint = angle(random);
    const auto shapes = arm_shapes(q);
    const auto wrist2 = std::ranges::find(shapes, Part::kWrist2, &PartShape::part);
    const auto wrist3 = std::ranges::find(shapes, Part::kWrist3, &PartShape::part);
    // Links' frames and the table of Denavit and Hartenberg are two descriptions of one arm: wrist 2's axis and wrist
    // 3's cross 82 mm behind the flange.
    const auto flange = flange_pose(Dh::ur5(), q);
    const Vector3d crossing = flange * Vector3d(0, 0, -0.0823);
    const Vector3d axis = (wrist2->capsule.b - wrist2->capsule.a).normalized();
    EXPECT_LT((crossing - wrist2->capsule.a).cross(axis).norm(), 1e-9);
    EXPECT_LT((wrist3->capsule.b - flange.translation()).norm(), 0.039);
  }
}

TEST(ArmShapes, DistancesOfCapsulesAreThoseOfGeometry) {
  const Capsule x{{0, 0, 0}, {1, 0, 0}, 0.1};
  EXPECT_NEAR(distance(x, {{0.5, -1, 1}, {0.5, 1, 1}, 0.2}), 0.7, 1e-12);     // crosses above
  EXPECT_NEAR(distance(x, {{0.2, 0, 0.5}, {0.8, 0, 0.5}, 0.1}), 0.3, 1e-12);  // parallel
  EXPECT_NEAR(distance(x, {{2, 0, 0}, {3, 0, 0}, 0.1}), 0.8, 1e-12);          // beyond its end
  EXPECT_NEAR(distance(x, {{1.3, 0.4, 0}, {1.3, 0.4, 0}, 0.0}), 0.4, 1e-12);  // a point: 3-4-5
  EXPECT_NEAR(distance(x, {{0.5, 0, -1}, {0.5, 0, 1}, 0.1}), -0.2, 1e-12);    // through it
}

TEST(ArmShapes, DistancesToABoxAreThoseOfGeometry) {
  Obstacle box{.name = "box", .half = {0.5, 0.5, 0.5}};
  EXPECT_NEAR(distance({{-2, 0, 1}, {2, 0, 1}, 0.1}, box), 0.4, 1e-6);
  EXPECT_NEAR(distance({{0.8, 0.9, 0}, {0.8, 0.9, 3}, 0.0}, box), 0.5, 1e-6);  // beside an edge: 3-4-5
  EXPECT_LT(distance({{-2, 0, 0}, {2, 0, 0}, 0.1}, box), 0.0);
  box.X_WF = Eigen::Translation3d(0, 0, 5) * Eigen::AngleAxisd(std::numbers::pi / 4, Vector3d::UnitZ());
  EXPECT_NEAR(distance({{2, 0, 5}, {1, 0, 5}, 0.0}, box), 1 - std::sqrt(0.5), 1e-6);  // towards its corner
}

TEST(ArmShapes, HandThatIsHeldLevelTouchesNothing) {
  // Nearer to its base the folded forearm comes beside the shoulder.
  for (double x = -0.43; x <= 0.23; x += 0.04) {
    for (double y = -0.3; y <= 0.3; y += 0.05) {
      for (const double rotation : {-0.6, 0.0, 0.6}) {
        const auto q = planar::joints_at(kMounting, Dh::ur5(), {x, y, rotation});
        if (!q) continue;
        EXPECT_EQ(touched(*q, kMounting.base, {}), std::nullopt) << x << ", " << y << ", " << rotation;
      }
    }
  }
}

TEST(ArmShapes, FoldedArmTouchesItselfAndALowOneTheSurface) {
  EXPECT_THAT(touched({0, -1.5, 3.0, 0, 0, 0}, kMounting.base, {}).value_or("free"), HasSubstr("would touch its"));
  EXPECT_THAT(touched({0, 0.3, 0, 0, 0, 0}, kMounting.base, {}).value_or("free"), HasSubstr("would touch the surface"));
}

TEST(ArmShapes, FixtureInTheWayIsNamed) {
  const Joints q = level_at(-0.2, 0.0);
  const auto hand = arm_shapes(q).back().capsule;
  const Vector3d middle = kMounting.base * Vector3d(0.5 * (hand.a + hand.b));
  Obstacle post{.name = "post", .X_WF = Eigen::Isometry3d(Eigen::Translation3d(middle)), .half = {0.01, 0.01, 0.2}};
  EXPECT_EQ(touched(q, kMounting.base, std::span(&post, 1)), "the arm's gripper would touch 'post'");
  post.X_WF.translation().y() += 0.5;
  EXPECT_EQ(touched(q, kMounting.base, std::span(&post, 1)), std::nullopt);
}

}  // namespace
}  // namespace jostle::robot_bridge::ur
