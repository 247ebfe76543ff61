// What is wrong with a scene of pushing, and what the person who wrote it is told.

#include <gmock/gmock.h>

#include <cmath>
#include <string>
#include <vector>

#include "physics_pool/scene/scene.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using testing::HasSubstr;

// Line numbers below count from here.
const std::string kGood = R"(jostle_scene: 1
surface: {size: [1.0, 0.8]}
robot:
  model: pusher
  start: {x: -0.28, y: 0}
  radius: 0.0145
  height: 0.11
objects:
  - {name: a, shape: cylinder, radius: 0.05, height: 0.0245, mass: 0.5, friction: 0.2, pose: {x: -0.2, y: 0}}
task:
  kind: push
  target: a
  goal: {x: 0.2, y: 0, radius: 0.04}
  obstacle: {x: 0, y: 0, radius: 0.05}
physics: {time_step: 0.001, integrator: rk4}
)";

struct Case {
  std::string name;
  std::string from, to;  // replaced once
  std::vector<std::string> told;
};

void PrintTo(const Case& value, std::ostream* out) { *out << value.name; }

std::string replaced(const std::string& from, const std::string& to) {
  std::string text = kGood;
  const auto at = text.find(from);
  if (at == std::string::npos)
    ADD_FAILURE() << "no '" << from << "' in the good scene";
  else
    text.replace(at, from.size(), to);
  return text;
}

class MalformedPushScene : public testing::TestWithParam<Case> {};

TEST_P(MalformedPushScene, IsRefusedWithFileLineFieldGotAndWanted) {
  const auto scene = parse_scene(replaced(GetParam().from, GetParam().to), "bad.yaml");
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, Code::kInvalidArgument);
  for (const std::string& words : GetParam().told) {
    EXPECT_THAT(scene.error().message, HasSubstr(words));
  }
}

const std::vector<Case> kCases{
    {"GraspWithAPusher",
     "kind: push",
     "kind: grasp",
     {"bad.yaml:11", "task.kind", "got 'grasp' for the robot 'pusher'", "which has no hand"}},
    {"UnknownRobot",
     "model: pusher",
     "model: broom",
     {"bad.yaml:4", "robot.model", "got 'broom'", "planar_gripper, pusher"}},
    {"UnknownTask", "kind: push", "kind: pull", {"bad.yaml:11", "task.kind", "got 'pull'", "grasp, push"}},
    {"NoGoal", "  goal: {x: 0.2, y: 0, radius: 0.04}\n", "", {"bad.yaml:11", "task.goal", "missing"}},
    {"GoalWithoutRadius",
     "goal: {x: 0.2, y: 0, radius: 0.04}",
     "goal: {x: 0.2, y: 0}",
     {"bad.yaml:13", "task.goal.radius", "missing", "wanted a number"}},
    {"GoalOffTheTable",
     "goal: {x: 0.2",
     "goal: {x: 0.6",
     {"bad.yaml:13", "task.goal.x", "got 0.6", "-0.5 to 0.5 m, on the surface"}},
    {"NaNGoal", "goal: {x: 0.2", "goal: {x: .nan", {"bad.yaml:13", "task.goal.x", "got '.nan'", "a finite number"}},
    {"GoalOfNoSize", "radius: 0.04}", "radius: 0}", {"bad.yaml:13", "task.goal.radius", "got 0", "0.002 to 2 m"}},
    {"NaNObstacle",
     "radius: 0.05}\n",
     "radius: .nan}\n",
     {"bad.yaml:14", "task.obstacle.radius", "got '.nan'", "a finite number"}},
    {"NegativeObstacle", "radius: 0.05}\n", "radius: -0.05}\n", {"bad.yaml:14", "task.obstacle.radius", "got -0.05"}},
    {"ObstacleOffTheTable",
     "obstacle: {x: 0, y: 0",
     "obstacle: {x: 0, y: 0.5",
     {"bad.yaml:14", "task.obstacle.y", "got 0.5", "-0.4 to 0.4 m, on the surface"}},
    {"ObstacleAsANumber",
     "obstacle: {x: 0, y: 0, radius: 0.05}",
     "obstacle: 0.05",
     {"bad.yaml:14", "task.obstacle", "got '0.05'", "wanted a mapping"}},
    {"UnknownObstacleKey",
     "radius: 0.05}\n",
     "radius: 0.05, height: 1}\n",
     {"bad.yaml:14", "task.obstacle.height", "unknown key", "radius, x, y"}},
    {"PusherOfNoSize", "radius: 0.0145", "radius: 0", {"bad.yaml:6", "robot.radius", "got 0", "0.002 to 2 m"}},
    {"InfinitePusher", "height: 0.11", "height: .inf", {"bad.yaml:7", "robot.height", "got '.inf'", "a finite number"}},
    {"PusherInTheTarget",
     "{x: -0.28, y: 0}",
     "{x: -0.26, y: 0}",
     {"bad.yaml:9", "'a'", "inside the robot", "wanted a free place"}},
    {"UnknownIntegrator",
     "integrator: rk4",
     "integrator: rk5",
     {"bad.yaml:15", "physics.integrator", "got 'rk5'", "euler, rk4"}},
};

INSTANTIATE_TEST_SUITE_P(EveryKind, MalformedPushScene, testing::ValuesIn(kCases),
                         [](const auto& param) { return param.param.name; });

TEST(PushSceneYaml, ReadsBackBitForBit) {
  for (const Scene& scene : {tests::push_ahead(), tests::push_around()}) {
    Scene wanted = scene;
    wanted.task.goal = {.x = 0.1 + 0.2 - 0.3, .y = 1.0 / 3.0, .radius = 0.0401};
    wanted.robot = pusher({.x = -0.3, .radius = std::nextafter(0.0145, 1.0), .height = 0.1234567890123});
    wanted.physics.integrator = "rk4";
    const auto got = parse_scene(to_yaml(wanted), "again.yaml");
    ASSERT_TRUE(got) << got.error().message;
    EXPECT_EQ(got->robot, wanted.robot);
    EXPECT_EQ(got->task.goal.x, wanted.task.goal.x);
    EXPECT_EQ(got->task.goal.y, wanted.task.goal.y);
    EXPECT_EQ(got->task.goal.radius, wanted.task.goal.radius);
    ASSERT_EQ(got->task.obstacle.has_value(), wanted.task.obstacle.has_value());
    if (wanted.task.obstacle) {
      EXPECT_EQ(got->task.obstacle->radius, wanted.task.obstacle->radius);
    }
    EXPECT_EQ(got->physics.integrator, "rk4");
    EXPECT_EQ(to_yaml(*got), to_yaml(wanted));
    EXPECT_EQ(scene_hash(*got), scene_hash(wanted));
  }
}

TEST(PushScene, HasTwoJointsAndTwoAxes) {
  const StateLayout layout = layout_of(tests::push_around());
  EXPECT_THAT(layout.joints, testing::ElementsAre("pusher_x", "pusher_y"));
  EXPECT_EQ(layout.nu, 2);
  EXPECT_EQ(layout.nq, 2 + 2 * 7);
  EXPECT_EQ(layout.nv, 2 + 2 * 6);
}

TEST(SignedDistance, IsNegativeInsideAndExactOutside) {
  const SceneObject disc = tests::slider("disc", 0.3, 0.4);
  EXPECT_NEAR(signed_distance(disc, {.x = 0, .y = 0, .radius = 0.1}), 0.5 - 0.1 - 0.05115, 1e-15);
  SceneObject box = tests::box("box", 0.0, 0.0);                                                  // 4 cm x 4 cm
  EXPECT_NEAR(signed_distance(box, {.x = 0.05, .y = 0.06, .radius = 0.01}), 0.05 - 0.01, 1e-15);  // corner, 3-4-5
  EXPECT_NEAR(signed_distance(box, {.x = 0.025, .y = 0.0, .radius = 0.01}), -0.005, 1e-15);
  box.yaw = 0.7853981633974483;
  EXPECT_NEAR(signed_distance(box, {.x = 0.05, .y = 0.0, .radius = 0.01}), 0.05 - 0.02 * std::sqrt(2.0) - 0.01, 1e-12);
}

}  // namespace
}  // namespace jostle::physics_pool
