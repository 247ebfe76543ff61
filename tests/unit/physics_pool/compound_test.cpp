// Objects of several pieces: mugs, bowls.

#include <gmock/gmock.h>

#include <cmath>

#include "physics_pool/local/reduced_simulator.hpp"
#include "physics_pool/local/simulator.hpp"
#include "physics_pool/scenarios/household.hpp"
#include "physics_pool/uncertainty/realizations.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

SceneObject thing(Household kind, double x, double y, double yaw = 0) {
  SceneObject object = household_object(kind, to_string(kind), 0.3);
  object.x = x, object.y = y, object.yaw = yaw;
  return object;
}

// A mug beside a bowl beside a target, and the gripper before them.
Scene table() {
  Scene scene;
  scene.robot = planar_gripper({.x = -0.28});
  scene.objects = {box("target", 0.2, 0.2), thing(Household::kMug, -0.1, 0, 1.2), thing(Household::kBowl, 0.08, 0.02),
                   thing(Household::kSugarBox, 0, -0.2)};
  scene.task = {.kind = "grasp", .target = "target"};
  return scene;
}

TEST(Compound, ReadsBackFromItsText) {
  const Scene sut = table();
  ASSERT_TRUE(validate(sut, "table"));
  const auto again_result = parse_scene(to_yaml(sut), "table");
  ASSERT_TRUE(again_result) << again_result.error().message;
  EXPECT_EQ(scene_hash(*again_result), scene_hash(sut));
  EXPECT_EQ(again_result->objects[1].parts, sut.objects[1].parts);
  EXPECT_EQ(again_result->objects[2].parts, sut.objects[2].parts);
}

TEST(Compound, IsAsHighAndWideAsItsParts) {
  const SceneObject mug = thing(Household::kMug, 0, 0), bowl = thing(Household::kBowl, 0, 0);
  EXPECT_NEAR(mug.top(), 0.082, 1e-12);
  EXPECT_NEAR(mug.reach(), std::hypot(0.063, 0.006), 1e-12);  // a corner of the handle
  EXPECT_NEAR(bowl.top(), 0.053, 1e-12);
  EXPECT_NEAR(bowl.reach(), 0.0795, 1e-3);
}

TEST(Compound, MeetsOthersWithItsHandle) {
  const SceneObject mug = thing(Household::kMug, 0, 0);
  SceneObject other = box("other", 0.075, 0);  // 5 cm wide at most, its near side 5 cm from the mug's middle
  EXPECT_TRUE(overlap(mug, other));
  EXPECT_TRUE(overlap(other, mug));
  const SceneObject turned = thing(Household::kMug, 0, 0, 3.14);
  EXPECT_FALSE(overlap(turned, other));
}

TEST(Compound, RefusesPartsBelowItsFoot) {
  Scene scene = table();
  scene.objects[1].parts[0].pose.position[2] = -0.04;
  const auto valid = validate(scene, "table");
  ASSERT_FALSE(valid);
  EXPECT_THAT(valid.error().message, testing::HasSubstr("objects[1] ('mug').parts[0].pose: reaches"));
}

// A thing out of its parts falls on its foot, and stays there: its centre of mass is where the engine put it.
TEST(Compound, StandsStill) {
  const Scene scene = table();
  const auto world_result = World::compile(scene);
  ASSERT_TRUE(world_result) << world_result.error().message;
  Simulator sut(*world_result);
  const State start = initial_state(scene);
  State x = start;
  EXPECT_EQ(sut.advance(x, std::vector(4, 0.0), 1000).diverged, "");
  const StateLayout layout = layout_of(scene);
  for (const ObjectSlot& object : layout.objects) {
    for (int k = 0; k < 3; ++k) {
      const auto i = static_cast<std::size_t>(object.q + k);
      EXPECT_NEAR(x.q[i], start.q[i], 3e-4) << object.name << " " << k;
    }
  }
}

TEST(Compound, GrowsInOnePiece) {
  const Scene nominal = table();
  for (int world = 1; world <= 5; ++world) {
    const Scene real = realize(nominal, {}, 7, world);
    const SceneObject &mug = real.objects[1], &bowl = real.objects[2];
    const double factor = mug.radius / nominal.objects[1].radius;
    EXPECT_NEAR(mug.height / nominal.objects[1].height, factor, 1e-12);
    EXPECT_NEAR(mug.parts[0].pose.position[0] / nominal.objects[1].parts[0].pose.position[0], factor, 1e-12);
    EXPECT_NEAR(bowl.top() / nominal.objects[2].top(), bowl.radius / nominal.objects[2].radius, 1e-12);
    EXPECT_LE(std::abs(bowl.reach() - nominal.objects[2].reach()), 0.0051);
    EXPECT_TRUE(validate(real, "real"));
  }
}

// Frozen until touched, things go where they would go unfrozen.
TEST(Compound, MovesAlikeWhenWhatRestsIsFrozen) {
  const Scene scene = table();
  const auto world = World::compile(scene).value();
  Simulator full(world);
  ReducedSimulator sut(world, {.freeze = true});
  State x = initial_state(scene), y = x;
  const std::vector<double> u{0.15, 0, 0, 0};
  std::uint32_t thawed = 0;
  for (int t = 0; t < 4; ++t) {
    EXPECT_EQ(full.advance(x, u, 250).diverged, "");
    const Advance advance = sut.advance(y, u, 250);
    EXPECT_EQ(advance.diverged, "");
    thawed += advance.thawed;
  }
  EXPECT_GE(thawed, 2u);  // mug and bowl
  const StateLayout layout = layout_of(scene);
  const ObjectView mug(layout.objects[1], x), its(layout.objects[1], y);
  EXPECT_GT(mug.position()[0], 0.0);  // it was pushed along
  for (const ObjectSlot& object : layout.objects) {
    for (int k = 0; k < 3; ++k) {
      const auto i = static_cast<std::size_t>(object.q + k);
      EXPECT_NEAR(x.q[i], y.q[i], 0.01) << object.name << " " << k;
    }
  }
}

}  // namespace
}  // namespace jostle::physics_pool
