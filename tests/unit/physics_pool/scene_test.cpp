#include "physics_pool/scene/scene.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <numbers>

#include "physics_pool/scenarios/chapter3.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

using testing::HasSubstr;

void expect_same(const Scene& a, const Scene& b) {
  EXPECT_EQ(a.name, b.name);
  EXPECT_EQ(a.surface, b.surface);
  EXPECT_EQ(a.fixtures, b.fixtures);
  EXPECT_EQ(a.robot, b.robot);
  EXPECT_EQ(a.task.kind, b.task.kind);
  EXPECT_EQ(a.task.target, b.task.target);
  EXPECT_EQ(a.physics.time_step, b.physics.time_step);
  EXPECT_EQ(a.physics.iterations, b.physics.iterations);
  EXPECT_EQ(a.physics.tolerance, b.physics.tolerance);
  ASSERT_EQ(a.objects.size(), b.objects.size());
  for (std::size_t i = 0; i < a.objects.size(); ++i) {
    const SceneObject &p = a.objects[i], &q = b.objects[i];
    EXPECT_EQ(p.name, q.name);
    EXPECT_EQ(p.shape, q.shape);
    EXPECT_EQ(p.size, q.size);
    EXPECT_EQ(p.radius, q.radius);
    EXPECT_EQ(p.height, q.height);
    EXPECT_EQ(p.mass, q.mass);
    EXPECT_EQ(p.friction, q.friction);
    EXPECT_EQ(p.x, q.x);
    EXPECT_EQ(p.y, q.y);
    EXPECT_EQ(p.yaw, q.yaw);
  }
}

TEST(SceneYaml, ReadsBackBitForBitOverGeneratedScenes) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const auto scene = generate_chapter3({.objects = 8, .seed = seed});
    ASSERT_TRUE(scene) << scene.error().message;
    const std::string text = to_yaml(*scene);
    const auto again = parse_scene(text, "again.yaml");
    ASSERT_TRUE(again) << again.error().message;
    expect_same(*scene, *again);
    EXPECT_EQ(to_yaml(*again), text);
    EXPECT_EQ(scene_hash(*again), scene_hash(*scene));
  }
}

TEST(SceneYaml, ReadsBackAwkwardNumbersBitForBit) {
  Scene scene = tests::target_only();
  scene.objects[0].x = 0.1 + 0.2 - 0.3;  // 5.5e-17
  scene.objects[0].y = -1e-300;
  scene.objects[0].yaw = std::numbers::pi;
  scene.objects[0].mass = std::nextafter(0.3, 1.0);
  scene.physics.tolerance = 1.0 / 3.0 * 1e-7;
  const auto again = parse_scene(to_yaml(scene), "again.yaml");
  ASSERT_TRUE(again) << again.error().message;
  expect_same(scene, *again);
}

TEST(SceneYaml, ReadsBackShelvesBitForBit) {
  Scene scene = tests::three_objects();
  scene.surface = Surface::table(0.55, 0.71);
  scene.fixtures = shelf_walls(scene.surface.parts[0], 0.123);
  const auto again = parse_scene(to_yaml(scene), "again.yaml");
  ASSERT_TRUE(again) << again.error().message;
  expect_same(scene, *again);
}

TEST(SceneYaml, KeepsNamesThatNeedQuotes) {
  for (const std::string name : {"a: b", "- x", "\"quoted\"", "tab\tline\n", "42", "null", "ö水", "#"}) {
    Scene scene = tests::target_only();
    scene.name = scene.objects[0].name = scene.task.target = name;
    const auto again = parse_scene(to_yaml(scene), "again.yaml");
    ASSERT_TRUE(again) << name << ": " << again.error().message;
    expect_same(scene, *again);
  }
}

TEST(SceneYaml, FillsInDefaults) {
  const auto scene = parse_scene(R"(
jostle_scene: 1
objects:
  - {name: a, size: [0.04, 0.05, 0.06], mass: 0.5, friction: 0.4, pose: {x: 0.1, y: 0}}
task: {target: a}
)",
                                 "small.yaml");
  ASSERT_TRUE(scene) << scene.error().message;
  Scene wanted;
  wanted.objects = {{.name = "a", .size = {0.04, 0.05, 0.06}, .mass = 0.5, .friction = 0.4, .x = 0.1}};
  wanted.task.target = "a";
  expect_same(*scene, wanted);
}

TEST(SceneYaml, LoadsWhatWasWrittenToAFile) {
  const auto file = std::filesystem::path(testing::TempDir()) / "jostle_scene_test.yaml";
  std::ofstream(file) << to_yaml(tests::three_objects());
  const auto scene = load_scene(file);
  std::filesystem::remove(file);
  ASSERT_TRUE(scene) << scene.error().message;
  expect_same(*scene, tests::three_objects());
}

TEST(SceneYaml, NamesTheFileThatCannotBeRead) {
  const auto scene = load_scene("no/such/scene.yaml");
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, Code::kNotFound);
  EXPECT_THAT(scene.error().message, HasSubstr("no/such/scene.yaml"));
}

TEST(SceneHash, ChangesWithEveryField) {
  const Hash base = scene_hash(tests::three_objects());
  const auto expect_changed = [&](auto change) {
    Scene scene = tests::three_objects();
    change(scene);
    EXPECT_NE(scene_hash(scene), base);
  };
  EXPECT_EQ(scene_hash(tests::three_objects()), base);
  expect_changed([](Scene& s) { s.surface.parts[0].size[1] += 1e-12; });
  expect_changed([](Scene& s) { s.surface.parts.push_back({.x = 0.4, .size = {0.1, 0.2}}); });
  expect_changed([](Scene& s) { s.fixtures = shelf_walls(s.surface.parts[0], 0.2); });
  expect_changed([](Scene& s) { s.robot.q[0] = std::nextafter(s.robot.q[0], 0.0); });
  expect_changed([](Scene& s) { s.robot.q[kJointLeft] -= 0.001; });
  expect_changed([](Scene& s) { s.robot.base.position[2] += 0.001; });
  expect_changed([](Scene& s) { s.robot.model.joints[0].gain += 1e-9; });
  expect_changed([](Scene& s) { s.objects[0].mass += 1e-9; });
  expect_changed([](Scene& s) { s.objects[1].radius += 1e-9; });
  expect_changed([](Scene& s) { s.objects[2].yaw += 1e-9; });
  expect_changed([](Scene& s) { std::swap(s.objects[1], s.objects[2]); });
  expect_changed([](Scene& s) { s.task.target = "can"; });
  expect_changed([](Scene& s) { s.physics.time_step = 0.001; });
}

TEST(Scene, RestsObjectsOnTheSurface) {
  EXPECT_DOUBLE_EQ(tests::box("b", 0, 0).rest_height(), 0.019);
  EXPECT_DOUBLE_EQ(tests::cylinder("c", 0, 0).rest_height(), 0.025);
}

TEST(Scene, FindsItsTarget) {
  Scene scene = tests::three_objects();
  EXPECT_EQ(scene.target(), 0);
  scene.task.target = "carton";
  EXPECT_EQ(scene.target(), 2);
  scene.task.target = "nobody";
  EXPECT_EQ(scene.target(), -1);
}

TEST(Layout, PutsTheRobotFirstAndThenEveryObject) {
  const StateLayout layout = layout_of(tests::three_objects());
  EXPECT_EQ(layout.nq, 5 + 3 * 7);
  EXPECT_EQ(layout.nv, 5 + 3 * 6);
  EXPECT_EQ(layout.nu, 4);
  EXPECT_EQ(layout.target, 0);
  ASSERT_EQ(layout.joints.size(), 5u);
  ASSERT_EQ(layout.objects.size(), 3u);
  EXPECT_EQ(layout.objects[2], (ObjectSlot{.name = "carton", .q = 5 + 14, .v = 5 + 12}));
}

TEST(InitialState, IsAtRestWhereTheSceneSays) {
  Scene scene = tests::three_objects();
  scene.robot = planar_gripper({.x = -0.31, .y = 0.02, .rotation = 0.1, .opening = 0.06});
  const State x = initial_state(scene);
  EXPECT_EQ(x.v, std::vector<double>(23, 0.0));
  ASSERT_EQ(x.q.size(), 26u);
  EXPECT_EQ(x.q[kJointX], -0.31);
  EXPECT_EQ(x.q[kJointY], 0.02);
  EXPECT_EQ(x.q[kJointRotation], 0.1);
  EXPECT_EQ(x.q[kJointLeft], 0.03);
  EXPECT_EQ(x.q[kJointRight], 0.03);
  EXPECT_EQ(x.q[19], 0.1);
  EXPECT_EQ(x.q[20], -0.1);
  EXPECT_DOUBLE_EQ(x.q[21], 0.019);
  EXPECT_DOUBLE_EQ(x.q[22], std::cos(0.25));
  EXPECT_EQ(x.q[23], 0.0);
  EXPECT_EQ(x.q[24], 0.0);
  EXPECT_DOUBLE_EQ(x.q[25], std::sin(0.25));
}

// Footprints: gaps known from geometry.

TEST(Overlap, OfDiscsIsTheDistanceOfCentresLessTheRadii) {
  const SceneObject a = tests::cylinder("a", 0, 0);
  const double touching = 2 * a.radius;
  EXPECT_TRUE(overlap(a, tests::cylinder("b", touching * 0.6 - 1e-6, touching * 0.8)));
  EXPECT_FALSE(overlap(a, tests::cylinder("b", touching * 0.6 + 1e-6, touching * 0.8)));
  EXPECT_TRUE(overlap(a, tests::cylinder("b", 0, touching + 0.0029), 0.003));
  EXPECT_FALSE(overlap(a, tests::cylinder("b", 0, touching + 0.0031), 0.003));
}

TEST(Overlap, OfRectanglesFollowsTheirRotation) {
  // Square of side 0.04 on its corner reaches 0.04/sqrt(2) along x.
  const SceneObject a = tests::box("a", 0, 0);
  const double reach = 0.02 + 0.04 / std::sqrt(2.0);
  EXPECT_TRUE(overlap(a, tests::box("b", reach - 1e-6, 0, std::numbers::pi / 4)));
  EXPECT_FALSE(overlap(a, tests::box("b", reach + 1e-6, 0, std::numbers::pi / 4)));
  EXPECT_FALSE(overlap(a, tests::box("b", reach - 1e-6, 0, 0.0)) && !overlap(a, tests::box("b", 0.04 - 1e-6, 0, 0.0)));
}

TEST(Overlap, OfADiscAndACornerIsRound) {
  const SceneObject square = tests::box("a", 0, 0);
  SceneObject disc = tests::cylinder("b", 0, 0);
  const double d = disc.radius / std::sqrt(2.0);
  disc.x = disc.y = 0.02 + d - 1e-6;
  EXPECT_TRUE(overlap(square, disc));
  disc.x = disc.y = 0.02 + d + 1e-6;
  EXPECT_FALSE(overlap(square, disc));  // their bounding boxes do overlap
}

TEST(Overlap, IsSymmetric) {
  const auto scene = generate_chapter3({.objects = 12, .seed = 3});
  ASSERT_TRUE(scene);
  for (const SceneObject& a : scene->objects) {
    for (const SceneObject& b : scene->objects) {
      for (const double gap : {0.0, 0.01, 0.05}) EXPECT_EQ(overlap(a, b, gap), overlap(b, a, gap));
    }
  }
}

TEST(Overlap, SeesAnObjectInsideAnother) {
  SceneObject small = tests::box("b", 0.001, 0);
  small.size = {0.01, 0.01, 0.01};
  EXPECT_TRUE(overlap(tests::box("a", 0, 0), small));
  EXPECT_TRUE(overlap(tests::cylinder("a", 0, 0), small));
  EXPECT_TRUE(overlap(small, tests::cylinder("a", 0, 0)));
}

TEST(OverlapsRobot, LeavesTheSpaceBetweenTheFingersFree) {
  Scene scene = tests::target_only();
  scene.robot = planar_gripper({.x = 0, .y = 0, .rotation = 0, .opening = 0.085});
  EXPECT_FALSE(overlaps_robot(scene, tests::box("b", kHand.depth, 0)));
  EXPECT_TRUE(overlaps_robot(scene, tests::box("b", kHand.depth, 0.03)));   // left finger
  EXPECT_TRUE(overlaps_robot(scene, tests::box("b", kHand.depth, -0.03)));  // right finger
  EXPECT_TRUE(overlaps_robot(scene, tests::box("b", -0.05, 0)));            // palm
  EXPECT_TRUE(overlaps_robot(scene, tests::box("b", -0.25, 0)));            // arm
  EXPECT_FALSE(overlaps_robot(scene, tests::box("b", kHand.finger_length + 0.021, 0.05)));
}

TEST(OverlapsRobot, TurnsWithTheRobot) {
  Scene scene = tests::target_only();
  scene.robot = planar_gripper({.x = 0, .y = 0, .rotation = std::numbers::pi / 2, .opening = 0.085});
  EXPECT_TRUE(overlaps_robot(scene, tests::box("b", 0, -0.25)));  // arm now along -y
  EXPECT_FALSE(overlaps_robot(scene, tests::box("b", -0.25, 0)));
  EXPECT_TRUE(overlaps_robot(scene, tests::box("b", 0.045, 0.04)));  // right finger at +x
}

}  // namespace
}  // namespace jostle::physics_pool
