// Surfaces of several parts and bodies that never move: their text, and what they do to objects and robots.

#include <gmock/gmock.h>

#include <cmath>

#include "physics_pool/local/simulator.hpp"
#include "tests/support/arms.hpp"
#include "tests/support/planar.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr double kGravity = 9.81;

// A table of an L and a strip apart from it, the gripper far away.
Scene parts() {
  Scene scene = target_only();
  scene.name = "parts";
  scene.robot = planar_gripper({.x = -3});
  scene.surface = {
      {{.size = {0.6, 0.2}}, {.x = 0.2, .y = 0.3, .size = {0.2, 0.4}}, {.x = -0.2, .y = 0.4, .size = {0.2, 0.1}}}};
  return scene;
}

Fixture box_fixture(std::string name, std::array<double, 3> size, Pose pose) {
  return {.name = std::move(name), .size = size, .pose = pose};
}

Fixture post(std::string name, double x, double y, double radius = 0.02) {
  return {.name = std::move(name),
          .shape = Shape::kCylinder,
          .radius = radius,
          .height = 0.2,
          .pose = {.position = {x, y, 0.1}}};
}

// Text.

TEST(FixturesText, ReadsBackBitForBit) {
  Scene scene = parts();
  scene.surface.parts[1].x = 0.1 + 0.2;  // its last bit is not 0.3's
  scene.surface.parts[1].y = std::nextafter(0.3, 1.0);
  scene.fixtures = shelf_walls(scene.surface.parts[0], 0.123);
  scene.fixtures.push_back(box_fixture("a: \"board\"", {0.2, 1.0 / 3.0, 0.02},
                                       {.position = {0.1 + 0.2, -1e-17, 0.5}, .orientation = {0.5, 0.5, -0.5, 0.5}}));
  scene.fixtures.push_back(post("post", 0.25, 0.4, 1.0 / 70.0));
  scene.fixtures.back().pose.orientation = turned_about_z(0.7);
  ASSERT_TRUE(validate(scene, "scene")) << validate(scene, "scene").error().message;
  const auto again = parse_scene(to_yaml(scene), "again.yaml");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->surface, scene.surface);
  EXPECT_EQ(again->fixtures, scene.fixtures);
  EXPECT_EQ(again->robot, scene.robot);
  EXPECT_EQ(to_yaml(*again), to_yaml(scene));
  EXPECT_EQ(scene_hash(*again), scene_hash(scene));
}

TEST(FixturesText, KeepsAnArmsBaseBitForBit) {
  Scene scene = two_links_reach();
  scene.robot.base = {.position = {-0.4, 1.0 / 3.0, 0.1 + 0.2}, .orientation = turned_about_z(1.0 / 3.0)};
  const auto again = parse_scene(to_yaml(scene), "again.yaml");
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again->robot, scene.robot);
}

const std::string kText = R"(jostle_scene: 2
surface:
  parts:
    - {size: [0.6, 0.2]}
    - {x: 0.2, y: 0.3, size: [0.2, 0.4]}
fixtures:
  - name: board
    size: [0.2, 0.1, 0.02]
    pose: {position: [0.2, 0.3, 0.3], yaw: 0.5}
  - {name: post, shape: cylinder, radius: 0.02, height: 0.2, pose: {position: [0, 0.05, 0.1]}}
robot:
  model: planar_gripper
  start: {gripper_x: -0.4}
objects:
  - {name: a, size: [0.04, 0.04, 0.04], mass: 0.5, friction: 0.4, pose: {x: 0.2, y: 0.3}}
task: {target: a}
)";

TEST(FixturesText, IsShortForPeople) {
  const auto scene_result = parse_scene(kText, "parts.yaml");
  ASSERT_TRUE(scene_result) << scene_result.error().message;
  EXPECT_THAT(scene_result->surface.parts,
              ElementsAre(Rectangle{.size = {0.6, 0.2}}, Rectangle{.x = 0.2, .y = 0.3, .size = {0.2, 0.4}}));
  Fixture board =
      box_fixture("board", {0.2, 0.1, 0.02}, {.position = {0.2, 0.3, 0.3}, .orientation = turned_about_z(0.5)});
  EXPECT_THAT(scene_result->fixtures, ElementsAre(board, post("post", 0, 0.05)));
  EXPECT_EQ(scene_result->robot.q[kJointX], -0.4);
  EXPECT_EQ(scene_result->robot.q[kJointLeft], 0.0425);  // the model's own start
}

struct Case {
  std::string name, from, to;
  std::vector<std::string> told;
};

void PrintTo(const Case& value, std::ostream* out) { *out << value.name; }

class MalformedFixtures : public testing::TestWithParam<Case> {};

TEST_P(MalformedFixtures, AreRefusedWithFileLineFieldGotAndWanted) {
  std::string text = kText;
  const auto at = text.find(GetParam().from);
  ASSERT_NE(at, text.npos);
  text.replace(at, GetParam().from.size(), GetParam().to);
  const auto scene_result = parse_scene(text, "bad.yaml");
  ASSERT_FALSE(scene_result);
  EXPECT_EQ(scene_result.error().code, Code::kInvalidArgument);
  for (const std::string& words : GetParam().told) EXPECT_THAT(scene_result.error().message, HasSubstr(words));
}

INSTANTIATE_TEST_SUITE_P(
    EveryKind, MalformedFixtures,
    testing::Values(
        Case{"NoPart",
             "parts:\n    - {size: [0.6, 0.2]}\n    - {x: 0.2, y: 0.3, size: [0.2, 0.4]}",
             "parts: []",
             {"bad.yaml:", "surface", "got no part"}},
        Case{"PartsThatOverlap",
             "y: 0.3, size: [0.2, 0.4]",
             "y: 0.3, size: [0.2, 0.5]",
             {"bad.yaml:5", "surface.parts[1]", "overlaps part 0", "wanted parts that meet"}},
        Case{
            "PartOfNoWidth", "size: [0.6, 0.2]", "size: [0.6, 0]", {"bad.yaml:4", "surface.parts[0].size[1]", "got 0"}},
        Case{"PartWithoutSize", "{size: [0.6, 0.2]}", "{x: 0}", {"bad.yaml:4", "surface.parts[0].size", "missing"}},
        Case{"FixtureWithoutName", "name: board", "name: ''", {"bad.yaml:7", "fixtures[0]", "got ''", "wanted a name"}},
        Case{"TwoFixturesOfOneName", "name: post", "name: board", {"bad.yaml:10", "fixtures[1]", "already taken"}},
        Case{"ObjectNamedAsAFixture", "{name: a,", "{name: post,", {"bad.yaml:15", "objects[0]", "already taken"}},
        Case{"FixtureOfNoHeight",
             "[0.2, 0.1, 0.02]",
             "[0.2, 0.1, 0]",
             {"bad.yaml:8", "fixtures[0]", "size[2]", "got 0"}},
        Case{"FixtureWithoutPose",
             "    pose: {position: [0.2, 0.3, 0.3], yaw: 0.5}\n",
             "",
             {"bad.yaml:7", "fixtures[0].pose", "missing"}},
        Case{"FixtureNowhere", "[0.2, 0.3, 0.3]", "[0.2, .nan, 0.3]", {"bad.yaml:9", "pose.position[1]", "got '.nan'"}},
        Case{"FixtureStretched",
             "yaw: 0.5",
             "orientation: [1, 1, 0, 0]",
             {"bad.yaml:9", "orientation", "unit quaternion"}},
        Case{"ObjectOnNoPart",
             "{x: 0.2, y: 0.3}}",
             "{x: 0, y: 0.3}}",
             {"bad.yaml:15", "'a'", "on no part of the surface"}},
        Case{"JointThatThereIsNot",
             "gripper_x",
             "gripper_w",
             {"bad.yaml:13", "start", "got joint 'gripper_w'", "gripper_x"}},
        Case{"RobotThatThereIsNot",
             "model: planar_gripper",
             "model: humanoid",
             {"bad.yaml:12", "got 'humanoid'", "pusher"}},
        Case{"BaseOfAPlanarRobot",
             "model: planar_gripper",
             "base: {position: [-0.1, 0, 0]}",
             {"bad.yaml:12", "robot.base", "got a pose", "robot.start says where it is"}}),
    [](const auto& param) { return param.param.name; });

TEST(ShelfWalls, StandRoundEverySideButTheRobots) {
  const Rectangle surface{.x = 0.1, .y = -0.2, .size = {0.6, 0.4}};
  const std::vector<Fixture> walls = shelf_walls(surface, 0.15);
  ASSERT_EQ(walls.size(), 3u);
  for (const Fixture& wall : walls) {
    EXPECT_EQ(wall.size[2], 0.15);
    EXPECT_EQ(wall.pose.position[2], 0.075);  // they stand on the surface's level
    EXPECT_EQ(wall.pose.orientation, Pose{}.orientation);
  }
  const auto side = [&](int wall, std::size_t axis, int sign) {
    const Fixture& f = walls[static_cast<std::size_t>(wall)];
    return f.pose.position[axis] + sign * f.size[axis] / 2;
  };
  // Back, left and right; the sides that look inwards are the surface's.
  EXPECT_NEAR(side(0, 0, -1), surface.high_x(), 1e-12);
  EXPECT_NEAR(side(1, 1, -1), surface.high_y(), 1e-12);
  EXPECT_NEAR(side(2, 1, 1), surface.low_y(), 1e-12);
  for (const int wall : {1, 2}) {
    EXPECT_NEAR(side(wall, 0, -1), surface.low_x(), 1e-12);
    EXPECT_NEAR(side(wall, 0, 1), surface.high_x(), 1e-12);
  }
  // The back closes the corners.
  EXPECT_NEAR(side(0, 1, -1), side(2, 1, -1), 1e-12);
  EXPECT_NEAR(side(0, 1, 1), side(1, 1, 1), 1e-12);
}

// Physics.

WorldPtr compiled(const Scene& scene) {
  auto world_result = World::compile(scene);
  if (!world_result) throw std::runtime_error(world_result.error().message);
  return std::move(world_result).value();
}

class Fixtures : public testing::Test {
 protected:
  // Starts at x and goes on for some time.
  Advance run(const Scene& scene, std::vector<double> u, double seconds) {
    const WorldPtr world = compiled(scene);
    layout = world->geometry().layout;
    u.resize(static_cast<std::size_t>(layout.nu));
    Simulator simulator(world);
    Advance advance = simulator.advance(x, u, static_cast<int>(std::lround(seconds / world->time_step())));
    EXPECT_EQ(advance.diverged, "");
    return advance;
  }
  Advance run_from_start(const Scene& scene, std::vector<double> u, double seconds) {
    x = initial_state(scene);
    return run(scene, std::move(u), seconds);
  }
  const double* place(std::size_t i) const { return StateView(layout, x).object(i).position(); }
  const double* velocity(std::size_t i) const { return StateView(layout, x).object(i).linear_velocity(); }

  State x;
  StateLayout layout;
};

TEST_F(Fixtures, LetAnObjectStandOnEachPart) {
  Scene scene = parts();
  scene.objects = {box("target", -0.25, 0), box("b", 0.25, 0.45), box("c", -0.2, 0.4), box("on the seam", 0.2, 0.1)};
  (void)run_from_start(scene, {}, 1.0);
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    EXPECT_NEAR(place(i)[0], scene.objects[i].x, 1e-4);
    EXPECT_NEAR(place(i)[1], scene.objects[i].y, 1e-4);
    EXPECT_NEAR(place(i)[2], 0.019, 1e-4);
  }
}

// Euler's method with step h is late by g·h·t/2.
TEST_F(Fixtures, LetAnObjectFallWhereNoPartIs) {
  Scene scene = parts();
  scene.objects = {box("target", -0.25, 0), box("b", 0.25, 0.45)};
  x = initial_state(scene);
  const auto second = static_cast<std::size_t>(layout_of(scene).objects[1].q);
  x.q[second] = 0.0, x.q[second + 1] = 0.3;  // in the L's inner corner
  const double t = 0.2, h = scene.physics.time_step;
  (void)run(scene, {}, t);
  EXPECT_NEAR(place(0)[2], 0.019, 1e-4);
  EXPECT_NEAR(place(1)[2], 0.019 - kGravity * t * t / 2, kGravity * h * t / 2 + 1e-9);
}

// v0^2 / (2 mu g), as on one table.
TEST_F(Fixtures, LetAnObjectSlideAcrossASeam) {
  Scene scene = parts();
  scene.objects = {box("target", 0.2, 0.05)};
  scene.objects[0].size[2] = 0.02;  // flat, so that it does not rock
  x = initial_state(scene);
  const double speed = 1.0, distance = speed * speed / (2 * 0.4 * kGravity);
  x.v[static_cast<std::size_t>(layout_of(scene).objects[0].v) + 1] = speed;
  (void)run(scene, {}, 0.6);
  EXPECT_NEAR(place(0)[1], 0.05 + distance, 0.05 * distance);
  EXPECT_NEAR(place(0)[0], 0.2, 1e-3);
  EXPECT_NEAR(place(0)[2], 0.01, 1e-3);
}

TEST_F(Fixtures, StopAnObjectThatSlidesIntoThem) {
  for (const Fixture& fixture :
       {box_fixture("wall", {0.02, 0.2, 0.1}, {.position = {0.16, 0, 0.05}}), post("post", 0.17, 0),
        // On its edge, turned by 45 degrees about y: its corner is 0.05·sqrt(2) from its middle.
        box_fixture("roof", {0.1, 0.2, 0.1},
                    {.position = {0.15 + 0.05 * std::sqrt(2.0), 0, 0.019},
                    .orientation = {std::cos(std::numbers::pi / 8), 0, std::sin(std::numbers::pi / 8), 0}})}) {
    SCOPED_TRACE(fixture.name);
    Scene scene = target_only();
    scene.robot = planar_gripper({.x = -3});
    scene.fixtures = {fixture};
    x = initial_state(scene);
    x.v[static_cast<std::size_t>(layout_of(scene).objects[0].v)] = 1.2;  // enough for 18 cm
    const Advance advance = run(scene, {}, 1.0);
    EXPECT_LT(place(0)[0], 0.15 - 0.02 + 2e-3);
    EXPECT_GT(place(0)[0], 0.05);
    EXPECT_NEAR(place(0)[2], 0.019, 2e-3);
    EXPECT_FALSE(advance.facts.robot_hit_fixture);  // an object did
  }
}

TEST_F(Fixtures, StopAnObjectThatIsPushedIntoThem) {
  Scene scene = target_only();
  scene.robot = planar_gripper({.x = -0.1});
  scene.fixtures = {box_fixture("wall", {0.02, 0.4, 0.1}, {.position = {0.16, 0, 0.05}})};
  // The fingers enclose the box; the palm pushes it from 8 cm behind over 13 cm of free way.
  const Advance advance = run_from_start(scene, {0.1}, 2.5);
  EXPECT_LT(place(0)[0], 0.13 + 2e-3);
  EXPECT_GT(place(0)[0], 0.07);
  EXPECT_TRUE(advance.facts.robot_hit_fixture);  // the fingertips reach the wall first
  EXPECT_LT(x.q[kJointX], 0.15 - 0.07 + 2e-3);
}

TEST_F(Fixtures, AreNoObstacleBelowABoard) {
  Scene scene = target_only();
  scene.robot = planar_gripper({.x = -3});
  scene.fixtures = {box_fixture("board", {0.1, 0.4, 0.02}, {.position = {0.1, 0, 0.06}})};
  x = initial_state(scene);
  x.v[static_cast<std::size_t>(layout_of(scene).objects[0].v)] = 1.2;
  (void)run(scene, {}, 1.0);
  EXPECT_GT(place(0)[0], 0.16);
}

TEST_F(Fixtures, CarryWhatStandsOnThem) {
  Scene scene = target_only();
  scene.robot = planar_gripper({.x = -3});
  scene.fixtures = {box_fixture("board", {0.2, 0.2, 0.02}, {.position = {0, 0, 0.29}})};
  x = initial_state(scene);
  const auto target = static_cast<std::size_t>(layout_of(scene).objects[0].q);
  x.q[target + 2] = 0.3 + 0.019;
  (void)run(scene, {}, 1.0);
  EXPECT_NEAR(place(0)[2], 0.3 + 0.019, 1e-3);
}

// A robot that touches one.

TEST_F(Fixtures, AreFeltByALinkOfAnArm) {
  Scene scene = two_links_reach();
  scene.fixtures = {post("post", -0.2, 0.1)};  // beside the upper arm, 0.2 m along and 0.1 m to the left
  const Advance advance = run_from_start(scene, {0.5}, 2.0);
  EXPECT_TRUE(advance.facts.robot_hit_fixture);
  // The bar is half 0.03 m wide, the post 0.02 m: they touch where the post's middle is 0.035 m from the bar's.
  const double touch = std::atan2(0.1, 0.2) - std::asin(0.035 / std::hypot(0.1, 0.2));
  EXPECT_NEAR(x.q[0], touch, 0.01);
  EXPECT_NEAR(x.v[0], 0, 0.01);
}

TEST_F(Fixtures, AreNotFeltByAnArmThatPassesThem) {
  Scene scene = two_links_reach();
  scene.fixtures = {post("post", -0.2, 0.1)};
  EXPECT_FALSE(run_from_start(scene, {-0.5}, 2.0).facts.robot_hit_fixture);
  EXPECT_NEAR(x.q[0], -1.0, 0.05);
  // Nor by one that only comes near.
  EXPECT_FALSE(run_from_start(scene, {0.5}, 0.4).facts.robot_hit_fixture);
  // Nor where they are above it.
  scene.fixtures[0].pose.position[2] = 0.1 + 0.06;
  EXPECT_FALSE(run_from_start(scene, {0.5}, 2.0).facts.robot_hit_fixture);
  EXPECT_NEAR(x.q[0], 1.0, 0.05);
}

TEST_F(Fixtures, AreNotFeltThroughAnObject) {
  Scene scene = two_links_reach();
  // The lower arm pushes the target against a wall.
  scene.objects = {box("target", 0.05, 0.07)};
  scene.fixtures = {box_fixture("wall", {0.4, 0.02, 0.1}, {.position = {0.05, 0.12, 0.05}})};
  const Advance advance = run_from_start(scene, {0.1}, 1.0);
  EXPECT_LT(place(0)[1], 0.11 - 0.02 + 3e-3);
  EXPECT_GT(place(0)[1], 0.075);
  EXPECT_FALSE(advance.facts.robot_hit_fixture);
}

TEST_F(Fixtures, AreFeltByAPlanarRobotToo) {
  Scene scene = target_only();
  scene.objects[0].y = 0.15;
  scene.fixtures = shelf_walls(scene.surface.parts[0], 0.15);
  EXPECT_FALSE(run_from_start(scene, {0.1}, 1.0).facts.robot_hit_fixture);
  EXPECT_TRUE(run_from_start(scene, {0.3}, 3.0).facts.robot_hit_fixture);
  EXPECT_LT(x.q[kJointX], 0.3 - kHand.finger_length + 2e-3);
}

// A fact of one control step is none of the next.
TEST_F(Fixtures, AreForgottenWhenAStepBegins) {
  Scene scene = two_links_reach();
  scene.fixtures = {post("post", -0.2, 0.1)};
  EXPECT_TRUE(run_from_start(scene, {0.5}, 2.0).facts.robot_hit_fixture);
  Simulator simulator(compiled(scene));
  const std::vector<double> back{-0.5, 0}, there{0.5, 0};
  EXPECT_TRUE(simulator.advance(x, there, 10).facts.robot_hit_fixture);
  (void)simulator.advance(x, back, 100);
  EXPECT_FALSE(simulator.advance(x, back, 100).facts.robot_hit_fixture);
}

// Where a scene may start.

std::string refusal(const Scene& scene) {
  const auto world_result = World::compile(scene);
  return world_result ? "it was compiled" : world_result.error().message;
}

TEST(FixturesAtTheStart, MayNotBeInsideALink) {
  Scene scene = two_links_reach();
  scene.fixtures = {post("post", -0.2, 0.03)};  // 5 mm inside the bar
  EXPECT_THAT(refusal(scene), AllOf(HasSubstr("two links"), HasSubstr("'bar'"), HasSubstr("'post'"),
                                    HasSubstr("5.0 mm inside"), HasSubstr("robot.start")));
  scene.fixtures = {post("post", 0.0, 0.03)};  // the lower arm's bar has no name
  EXPECT_THAT(refusal(scene), AllOf(HasSubstr("robot link 'lower'"), HasSubstr("'post'")));
  scene.fixtures = {post("post", 0.0, 0.0351)};
  EXPECT_TRUE(World::compile(scene));
}

TEST(FixturesAtTheStart, MayNotBeInsideAnObject) {
  Scene scene = two_links_reach();
  scene.fixtures = {box_fixture("wall", {0.02, 0.4, 0.1}, {.position = {0.226, 0, 0.05}})};  // 4 mm inside the box
  EXPECT_THAT(refusal(scene),
              AllOf(HasSubstr("object 'target'"), HasSubstr("'wall'"), HasSubstr("wanted free places")));
  scene.fixtures[0].pose.position[0] = 0.2301;
  EXPECT_TRUE(World::compile(scene));
}

TEST(FixturesAtTheStart, MayNotBeInsideAPlanarRobot) {
  Scene scene = target_only();
  scene.fixtures = {post("post", scene.robot.q[0] - 0.03, 0.07)};  // 10 mm inside the palm
  EXPECT_THAT(refusal(scene), AllOf(HasSubstr("'palm'"), HasSubstr("'post'")));
}

TEST(FixturesAtTheStart, MayTouchTheSurfaceAndEachOther) {
  Scene scene = two_links_reach();
  scene.fixtures = shelf_walls(scene.surface.parts[0], 0.15);
  scene.fixtures.push_back(box_fixture("slab", {0.6, 0.6, 0.02}, {.position = {0, 0, -0.011}}));
  EXPECT_EQ(refusal(scene), "it was compiled");
}

TEST(FixturesAtTheStart, AnObjectMayNotBeInsideALinkEither) {
  Scene scene = two_links_reach();
  scene.objects[0].x = 0.115;  // 5 mm inside the tool's end of the lower arm
  EXPECT_THAT(refusal(scene), AllOf(HasSubstr("object 'target'"), HasSubstr("robot link 'lower'")));
}

TEST(FixturesAtTheStart, TheArmOfTheseTestsIsFree) { EXPECT_EQ(refusal(seven_axis_reach()), "it was compiled"); }

}  // namespace
}  // namespace jostle::physics_pool
