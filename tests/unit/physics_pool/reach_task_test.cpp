// The task kind "reach".

#include <gmock/gmock.h>

#include <cmath>

#include "physics_pool/objective/scorer.hpp"
#include "physics_pool/scene/task_kind.hpp"
#include "physics_pool/task/task_geometry.hpp"
#include "tests/support/arms.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

class ReachTask : public testing::Test {
 protected:
  // Puts the target's centre there.
  void put_target(double px, double py, double pz) {
    const auto at = static_cast<std::size_t>(geometry.layout.objects[0].q);
    x.q[at] = px, x.q[at + 1] = py, x.q[at + 2] = pz;
  }

  const Scene scene = two_links_reach();  // its tool starts at (0.1, 0, 0.04)
  const TaskGeometry geometry{scene};
  const TaskKind& sut = *geometry.kind;
  State x = initial_state(scene);
};

TEST_F(ReachTask, IsInTheTable) {
  EXPECT_EQ(&sut, find_task_kind("reach"));
  EXPECT_FALSE(sut.has_goal);
  EXPECT_THAT(sut.purpose, testing::HasSubstr("tool"));
}

TEST_F(ReachTask, MeasuresTheDistanceFromToolToTarget) {
  put_target(0.13, -0.04, 0.16);  // 3, 4 and 12 cm away
  EXPECT_NEAR(sut.distance(geometry, x), 0.13, 1e-15);
  put_target(0.1, 0, 0.04);
  EXPECT_NEAR(sut.distance(geometry, x), 0, 1e-15);
}

TEST_F(ReachTask, MovesWithTheRobot) {
  put_target(-0.4, kUpper + kLower, 0.04);
  x.q[0] = std::numbers::pi / 2;
  EXPECT_NEAR(sut.distance(geometry, x), 0, 1e-15);
  x.q[1] = std::numbers::pi / 2;  // the tool is 0.2 m to the left of the elbow
  EXPECT_NEAR(sut.distance(geometry, x), std::hypot(kLower, kLower), 1e-15);
}

TEST_F(ReachTask, IsDoneWithin5Centimetres) {
  put_target(0.1 + 0.0499, 0, 0.04);
  EXPECT_TRUE(sut.reached(geometry, x));
  put_target(0.1 + 0.0501, 0, 0.04);
  EXPECT_FALSE(sut.reached(geometry, x));
  put_target(0.1, 0, 0.04 + 0.0501);  // height counts
  EXPECT_FALSE(sut.reached(geometry, x));
}

TEST_F(ReachTask, CostsTheSquaredDistanceWhateverTheBearing) {
  put_target(0.13, -0.04, 0.16);
  for (const double angle_weight : {0.0, 1.0, 10.0}) EXPECT_NEAR(sut.cost(geometry, x, angle_weight), 0.0169, 1e-15);
}

TEST_F(ReachTask, NeverFails) {
  EXPECT_EQ(sut.failure(geometry, x), "");
  put_target(3, 3, -0.7);
  EXPECT_EQ(sut.failure(geometry, x), "");
}

TEST_F(ReachTask, IsAtItsGoalOnlyWhenTheTargetStands) {
  const Objective objective = Objective::standard();
  EXPECT_FALSE(at_goal(geometry, x, objective));
  const double height = geometry.rest_heights[0];
  put_target(0.1, 0, height);
  EXPECT_TRUE(at_goal(geometry, x, objective));
  put_target(0.1, 0, height - 0.021);  // below where it rests
  EXPECT_FALSE(at_goal(geometry, x, objective));
  put_target(0.1, 0, height);
  const auto turn = static_cast<std::size_t>(geometry.layout.objects[0].q) + 3;
  x.q[turn] = std::cos(0.3), x.q[turn + 1] = std::sin(0.3);  // it leans by 0.6 rad
  EXPECT_FALSE(at_goal(geometry, x, objective));
}

TEST_F(ReachTask, PaysTheGoalTermOfItsDistance) {
  Objective objective;
  objective["goal"].weight = 3;
  put_target(0.13, -0.04, 0.16);
  EXPECT_NEAR(Scorer(objective).final(geometry, x), 3 * 0.0169, 1e-14);
}

TEST_F(ReachTask, SuitsEveryRobot) {
  Scene other = target_only();
  other.task.kind = "reach";
  EXPECT_TRUE(validate(other, "gripper"));
  other.robot = pusher({.x = -0.3});
  EXPECT_TRUE(validate(other, "pusher"));
  for (const Scene& arm : {scene, seven_axis_reach()}) EXPECT_TRUE(validate(arm, arm.name));
}

TEST(ReachTaskOfAGripper, MeasuresFromItsHand) {
  Scene scene = target_only();
  scene.task.kind = "reach";
  scene.robot = planar_gripper({.x = -0.3, .y = 0.04});
  const TaskGeometry geometry(scene);
  // G is 35 mm above the surface, the box's centre 19 mm.
  EXPECT_NEAR(geometry.kind->distance(geometry, initial_state(scene)), std::hypot(0.3, 0.04, 0.035 - 0.019), 1e-15);
}

TEST(ReachTaskText, NeedsNoGoal) {
  const auto scene_result = parse_scene(R"(
jostle_scene: 2
objects:
  - {name: a, size: [0.04, 0.05, 0.06], mass: 0.5, friction: 0.4, pose: {x: 0.1, y: 0}}
task: {kind: reach, target: a}
)",
                                        "reach.yaml");
  ASSERT_TRUE(scene_result) << scene_result.error().message;
  EXPECT_EQ(scene_result->task.kind, "reach");
  EXPECT_THAT(to_yaml(*scene_result), testing::Not(testing::HasSubstr("goal")));
}

TEST(ReachTaskScene, StartsShortOfItsTarget) {
  const Scene scene = seven_axis_reach();
  const TaskGeometry geometry(scene);
  const State x = initial_state(scene);
  EXPECT_NEAR(geometry.kind->distance(geometry, x), 0.1, 1e-3);
  EXPECT_FALSE(geometry.kind->reached(geometry, x));
  // The tool hangs over the table, its x axis down.
  const Eigen::Isometry3d X = tool_pose(geometry, x);
  EXPECT_NEAR(X.translation().z(), 0.03, 1e-3);
  EXPECT_NEAR(X.linear()(2, 0), -1, 1e-6);
}

}  // namespace
}  // namespace jostle::physics_pool
