#include "physics_pool/scenarios/push.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <set>
#include <string>

#include "physics_pool/objective/scorer.hpp"

namespace jostle::physics_pool {
namespace {

using testing::HasSubstr;

constexpr std::uint64_t kSeeds = 200;

Scene generated(Result<Scene> scene) {
  if (!scene) {
    ADD_FAILURE() << scene.error().message;
    return {};
  }
  return std::move(scene).value();
}

const SceneObject& target_of(const Scene& scene) { return scene.objects.at(static_cast<std::size_t>(scene.target())); }

// Distance of a point from the straight way of the target's centre, m.
double off_the_way(const Scene& scene, double x, double y) {
  const SceneObject& target = target_of(scene);
  const double dx = scene.task.goal.x - target.x, dy = scene.task.goal.y - target.y;
  return std::abs((y - target.y) * dx - (x - target.x) * dy) / std::hypot(dx, dy);
}

class GeneratePush : public testing::TestWithParam<Shape> {
 protected:
  std::vector<Scene> all_chapter6() const {
    std::vector<Scene> scenes;
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
      scenes.push_back(generated(generate_chapter6({.seed = seed, .shape = GetParam()})));
    }
    return scenes;
  }
  std::vector<Scene> all_chapter7(int objects = 3) const {
    std::vector<Scene> scenes;
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
      scenes.push_back(generated(generate_chapter7({.seed = seed, .shape = GetParam(), .objects = objects})));
    }
    return scenes;
  }
};

TEST_P(GeneratePush, GivesValidScenesThatReadBack) {
  for (const auto& scenes : {all_chapter6(), all_chapter7()}) {
    for (const Scene& scene : scenes) {
      const std::string text = to_yaml(scene);
      const auto again = parse_scene(text, "again.yaml");
      ASSERT_TRUE(again) << again.error().message;
      EXPECT_EQ(to_yaml(*again), text);
    }
  }
}

TEST_P(GeneratePush, PutsThePusherStraightBehindTheTarget) {
  for (const Scene& scene : all_chapter6()) {
    const SceneObject& target = target_of(scene);
    const double gap = signed_distance(
        target, {.x = scene.robot.q[0], .y = scene.robot.q[1], .radius = *disc_radius(scene.robot.model)});
    EXPECT_GE(gap, 0.01 - 1e-6);
    EXPECT_LE(gap, 0.02 + 1e-6);
    EXPECT_NEAR(off_the_way(scene, scene.robot.q[0], scene.robot.q[1]), 0.0, 1e-12);
    EXPECT_LT((scene.robot.q[0] - target.x) * (scene.task.goal.x - target.x), 0.0);
  }
}

TEST_P(GeneratePush, TheStraightPushRunsIntoTheObstacle) {
  for (const Scene& scene : all_chapter6()) {
    const TaskGeometry geometry(scene);
    State x = initial_state(scene);
    EXPECT_FALSE(target_hits_obstacle(geometry, x));
    EXPECT_FALSE(pusher_hits_obstacle(geometry, x));
    EXPECT_FALSE(at_goal(geometry, x, {}));
    bool hit = false;
    const int q = geometry.layout.objects.front().q;
    const double x0 = x.q[q], y0 = x.q[q + 1];
    for (int i = 0; i <= 100; ++i) {
      x.q[q] = x0 + i / 100.0 * (scene.task.goal.x - x0);
      x.q[q + 1] = y0 + i / 100.0 * (scene.task.goal.y - y0);
      hit = hit || target_hits_obstacle(geometry, x);
    }
    EXPECT_TRUE(hit);
    EXPECT_TRUE(at_goal(geometry, x, {}));
    EXPECT_FALSE(target_hits_obstacle(geometry, x));  // the goal region itself is free
  }
}

// On either side of the obstacle the target passes without coming near the edge.
TEST_P(GeneratePush, LeavesRoomToGoRound) {
  for (const Scene& scene : all_chapter6()) {
    const Disc& obstacle = *scene.task.obstacle;
    EXPECT_LE(off_the_way(scene, obstacle.x, obstacle.y), 0.02 + 1e-9);
    const double reach = obstacle.radius + (GetParam() == Shape::kBox ? 0.0945 : 0.05115);
    EXPECT_LT(std::abs(obstacle.y) + reach + 0.05, scene.surface.parts[0].size[1] / 2);
  }
}

TEST_P(GeneratePush, PutsOtherSlidersNearTheWayAndOutOfTheGoalRegion) {
  for (int objects : {0, 1, 3}) {
    for (const Scene& scene : all_chapter7(objects)) {
      ASSERT_EQ(scene.objects.size(), std::size_t(objects) + 1);
      EXPECT_FALSE(scene.task.obstacle);
      const SceneObject& target = target_of(scene);
      SceneObject arrived = target;
      arrived.x = scene.task.goal.x;
      arrived.y = scene.task.goal.y;
      for (std::size_t i = 1; i < scene.objects.size(); ++i) {
        const SceneObject& other = scene.objects[i];
        EXPECT_LE(off_the_way(scene, other.x, other.y), 0.16 + 1e-9);
        EXPECT_EQ(other.radius, target.radius);
        EXPECT_EQ(other.size, target.size);
        EXPECT_FALSE(overlap(other, arrived));
      }
    }
  }
}

TEST_P(GeneratePush, RepeatsForEqualSeedsAndDiffersForOthers) {
  std::set<std::string> texts;
  const std::vector<Scene> first = all_chapter7(), second = all_chapter7();
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(to_yaml(first[i]), to_yaml(second[i]));
    Scene renamed = first[i];
    renamed.name = "";  // the name holds the seed
    texts.insert(to_yaml(renamed));
  }
  EXPECT_EQ(texts.size(), kSeeds);
}

INSTANTIATE_TEST_SUITE_P(Shapes, GeneratePush, testing::Values(Shape::kCylinder, Shape::kBox),
                         [](const auto& param) { return param.param == Shape::kBox ? "Box" : "Cylinder"; });

TEST(GenerateChapter6, HasTheMeasuresOfTheAuthorsCode) {
  const Scene round = generated(generate_chapter6({}));
  EXPECT_EQ(*disc_radius(round.robot.model), 0.0145);
  EXPECT_EQ(round.robot.model.links[0].geoms[0].height, 0.11);
  EXPECT_EQ(round.objects[0].radius, 0.05115);
  EXPECT_EQ(round.objects[0].height, 0.0245);
  EXPECT_EQ(round.objects[0].mass, 0.5);
  EXPECT_EQ(round.objects[0].friction, 0.2);
  EXPECT_EQ(round.physics.time_step, 0.001);
  EXPECT_EQ(round.physics.integrator, "euler");
  const Scene square = generated(generate_chapter6({.shape = Shape::kBox, .integrator = "rk4"}));
  EXPECT_EQ(square.objects[0].size, (std::array{0.109, 0.154, 0.011}));
  EXPECT_EQ(square.objects[0].friction, 0.8);
  EXPECT_EQ(square.physics.integrator, "rk4");
}

TEST(GenerateChapter7, RefusesImpossibleCounts) {
  for (const int objects : {-1, 4, 1000}) {
    const auto scene = generate_chapter7({.objects = objects});
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().code, Code::kInvalidArgument);
    EXPECT_THAT(scene.error().message, HasSubstr(std::to_string(objects)));
    EXPECT_THAT(scene.error().message, HasSubstr("0 to 3"));
  }
}

TEST(GenerateChapter6, RefusesUnknownIntegrators) {
  const auto scene = generate_chapter6({.integrator = "leapfrog"});
  ASSERT_FALSE(scene);
  EXPECT_THAT(scene.error().message, HasSubstr("physics.integrator: got 'leapfrog', wanted one of: euler, rk4"));
}

}  // namespace
}  // namespace jostle::physics_pool
