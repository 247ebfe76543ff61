// The worlds of Sec. 5.6.

#include <gmock/gmock.h>

#include <cmath>

#include "physics_pool/scenarios/chapter5.hpp"

namespace jostle::physics_pool {
namespace {

constexpr std::uint64_t kSeeds = 200;
constexpr AdaptiveTask kPushes[] = {AdaptiveTask::kWide, AdaptiveTask::kStrip, AdaptiveTask::kChanging,
                                    AdaptiveTask::kL};

Scene scene_of(AdaptiveTask task, std::uint64_t seed) {
  auto result = generate_chapter5({.task = task, .seed = seed});
  if (!result) {
    ADD_FAILURE() << to_string(task) << ": " << result.error().message;
    return {};
  }
  return std::move(result).value();
}

void expect_in_footnote_1(const SceneObject& object) {
  const auto in = [](double value, double low, double high) { return value >= low && value <= high; };
  if (object.shape == Shape::kBox) {
    EXPECT_TRUE(in(object.size[0], 0.05, 0.075) && in(object.size[1], 0.05, 0.075) && in(object.size[2], 0.036, 0.05));
  } else {
    EXPECT_TRUE(in(object.radius, 0.04, 0.07) && in(object.height, 0.04, 0.05));
  }
  EXPECT_TRUE(in(object.mass, 0.2, 0.8) && in(object.friction, 0.2, 0.6));
}

TEST(Chapter5, PushedObjectsAreThoseOfTheFootnotesAndTheSameOnEveryTable) {
  int boxes = 0;
  double sum = 0.0, square = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const SceneObject target = scene_of(AdaptiveTask::kWide, seed).objects.at(0);
    expect_in_footnote_1(target);
    boxes += target.shape == Shape::kBox ? 1 : 0;
    sum += target.x;
    square += (target.x + 0.2) * (target.x + 0.2);
    for (const AdaptiveTask task : kPushes) {
      const Scene other = scene_of(task, seed);
      ASSERT_EQ(other.objects.size(), 1u);
      EXPECT_EQ(other.objects[0].x, target.x);
      EXPECT_EQ(other.objects[0].mass, target.mass);
    }
  }
  EXPECT_NEAR(boxes, kSeeds / 2.0, 5 * std::sqrt(kSeeds / 4.0));
  EXPECT_NEAR(sum / kSeeds, -0.2, 5 * 0.01 / std::sqrt(double{kSeeds}));
  EXPECT_NEAR(std::sqrt(square / kSeeds), 0.01, 5 * 0.01 / std::sqrt(2.0 * kSeeds));
}

TEST(Chapter5, TheHandIsOpenAndOneToTwoCentimetresBehind) {
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const Scene scene = scene_of(AdaptiveTask::kStrip, seed);
    EXPECT_FALSE(overlaps_robot(scene, scene.objects[0], 0.0095)) << seed;
    EXPECT_TRUE(overlaps_robot(scene, scene.objects[0], 0.0205)) << seed;
    EXPECT_EQ(scene.robot.q, planar_gripper({.x = scene.robot.q[0], .opening = 0.085}).q);
  }
}

TEST(Chapter5, TablesDifferInRoomAndGoal) {
  const Scene wide = scene_of(AdaptiveTask::kWide, 1), strip = scene_of(AdaptiveTask::kStrip, 1),
              changing = scene_of(AdaptiveTask::kChanging, 1), l = scene_of(AdaptiveTask::kL, 1);
  EXPECT_GT(wide.task.goal.radius, strip.task.goal.radius);
  EXPECT_TRUE(wide.surface.carries(0.0, 0.3));
  EXPECT_FALSE(strip.surface.carries(0.0, 0.11));
  EXPECT_TRUE(changing.surface.carries(-0.1, 0.25));
  EXPECT_FALSE(changing.surface.carries(0.1, 0.25));
  EXPECT_TRUE(l.surface.carries(l.task.goal.x, l.task.goal.y));
  EXPECT_FALSE(l.surface.carries(0.0, 0.2));  // the straight way crosses it
}

TEST(Chapter5, ClutterHasATargetThatFitsTheHandNearTheFarEdge) {
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    const Scene scene = scene_of(AdaptiveTask::kClutter, seed);
    ASSERT_EQ(scene.objects.size(), 9u);
    for (const SceneObject& object : scene.objects) expect_in_footnote_1(object);
    EXPECT_EQ(scene.objects[0].shape, Shape::kBox);
    EXPECT_NEAR(scene.objects[0].x, 0.2, 0.05);
    EXPECT_EQ(scene.task.kind, "grasp");
  }
}

TEST(Chapter5, RepeatsForEqualSeedsOnly) {
  for (const AdaptiveTask task : kPushes) {
    EXPECT_EQ(scene_hash(scene_of(task, 7)), scene_hash(scene_of(task, 7)));
    EXPECT_NE(scene_hash(scene_of(task, 7)), scene_hash(scene_of(task, 8)));
    EXPECT_EQ(parse_adaptive_task(to_string(task)), task);
  }
  EXPECT_FALSE(parse_adaptive_task("narrow"));
}

TEST(Chapter5, RefusesObjectsOutOfRange) {
  const auto result = generate_chapter5({.task = AdaptiveTask::kClutter, .objects = 21});
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, testing::HasSubstr("got 21, wanted 0 to 20"));
}

}  // namespace
}  // namespace jostle::physics_pool
