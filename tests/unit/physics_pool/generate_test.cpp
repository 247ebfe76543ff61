#include "physics_pool/scenarios/chapter3.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>
#include <set>
#include <string>

#include "tests/support/planar.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;
using testing::HasSubstr;

constexpr std::uint64_t kSeeds = 200;

Scene generated(const GenerateOptions& options) {
  auto scene = generate_chapter3(options);
  if (!scene) {
    ADD_FAILURE() << scene.error().message;
    return {};
  }
  return std::move(scene).value();
}

#define EXPECT_BETWEEN(value, low, high) \
  EXPECT_GE(value, low);                 \
  EXPECT_LE(value, high)

// Footnote 1 of Ch. 3, as full extents.
void expect_footnote_1(const SceneObject& object) {
  if (object.shape == Shape::kBox) {
    EXPECT_BETWEEN(object.size[0], 0.03, 0.05);
    EXPECT_BETWEEN(object.size[1], 0.03, 0.05);
    EXPECT_BETWEEN(object.size[2], 0.036, 0.04);
  } else {
    EXPECT_BETWEEN(object.radius, 0.035, 0.04);
    EXPECT_BETWEEN(object.height, 0.04, 0.055);
  }
  EXPECT_BETWEEN(object.mass, 0.2, 0.8);
  EXPECT_BETWEEN(object.friction, 0.2, 0.6);
}

TEST(GenerateChapter3, KeepsTheRangesOfTheFootnote) {
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const Scene scene = generated({.objects = 15, .seed = seed});
    ASSERT_EQ(scene.objects.size(), 16u);
    for (const SceneObject& object : scene.objects) expect_footnote_1(object);
  }
}

TEST(GenerateChapter3, FillsTheRangesOfTheFootnote) {
  // Of 3000 uniform draws the extremes lie within 1 % of the range's ends
  // except with probability 0.99^3000 < 1e-13.
  double least_mass = 1, most_mass = 0, least_friction = 1, most_friction = 0;
  int boxes = 0, all = 0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const Scene scene = generated({.objects = 15, .seed = seed});
    for (std::size_t i = 1; i < scene.objects.size(); ++i, ++all) {
      const SceneObject& object = scene.objects[i];
      least_mass = std::min(least_mass, object.mass);
      most_mass = std::max(most_mass, object.mass);
      least_friction = std::min(least_friction, object.friction);
      most_friction = std::max(most_friction, object.friction);
      boxes += object.shape == Shape::kBox ? 1 : 0;
    }
  }
  EXPECT_LT(least_mass, 0.206);
  EXPECT_GT(most_mass, 0.794);
  EXPECT_LT(least_friction, 0.204);
  EXPECT_GT(most_friction, 0.596);
  EXPECT_NEAR(boxes, all / 2.0, 5 * std::sqrt(all / 4.0));
}

TEST(GenerateChapter3, LeavesNothingInsideAnything) {
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const GenerateOptions options{.objects = 15, .seed = seed};
    const Scene scene = generated(options);
    for (std::size_t i = 0; i < scene.objects.size(); ++i) {
      EXPECT_FALSE(overlaps_robot(scene, scene.objects[i], options.gap));
      for (std::size_t j = 0; j < i; ++j) {
        EXPECT_FALSE(overlap(scene.objects[i], scene.objects[j], options.gap));
      }
    }
    const auto ok = validate(scene, "generated");
    EXPECT_TRUE(ok) << ok.error().message;
  }
}

TEST(GenerateChapter3, KeepsItsDistanceFromTheEdge) {
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const GenerateOptions options{.objects = 15, .seed = seed};
    const Scene scene = generated(options);
    for (const SceneObject& object : scene.objects) {
      EXPECT_LE(std::abs(object.x), scene.surface.parts[0].size[0] / 2 - options.edge_distance);
      EXPECT_LE(std::abs(object.y), scene.surface.parts[0].size[1] / 2 - options.edge_distance);
    }
  }
}

TEST(GenerateChapter3, PutsTheTargetNearTheCentre) {
  double sum = 0.0, square = 0.0;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const Scene scene = generated({.objects = 15, .seed = seed});
    ASSERT_GE(scene.target(), 0);
    const SceneObject& target = scene.objects[static_cast<std::size_t>(scene.target())];
    EXPECT_LT(std::abs(target.x), 0.05);  // 5 sigma
    EXPECT_LT(std::abs(target.y), 0.05);
    sum += target.x + target.y;
    square += target.x * target.x + target.y * target.y;
  }
  const double n = 2 * kSeeds, sigma = 0.01;
  EXPECT_NEAR(sum / n, 0.0, 5 * sigma / std::sqrt(n));
  EXPECT_NEAR(square / n / (sigma * sigma), 1.0, 5 * std::sqrt(2 / n));
}

TEST(GenerateChapter3, MakesATableOf60CmWithTheRobotOutside) {
  const Scene scene = generated({.objects = 15, .seed = 1});
  EXPECT_EQ(scene.surface, Surface::table(0.6, 0.6));
  EXPECT_TRUE(scene.fixtures.empty());
  EXPECT_EQ(scene.robot.model.name, "planar_gripper");
}

TEST(GenerateChapter3, RepeatsForEqualSeedsAndDiffersForOthers) {
  std::set<std::string> texts;
  for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
    const std::string text = to_yaml(generated({.objects = 15, .seed = seed}));
    EXPECT_EQ(to_yaml(generated({.objects = 15, .seed = seed})), text);
    Scene renamed = generated({.objects = 15, .seed = seed});
    renamed.name = "";  // the name holds the seed
    texts.insert(to_yaml(renamed));
  }
  EXPECT_EQ(texts.size(), kSeeds);
}

class GenerateCount : public testing::TestWithParam<int> {};

TEST_P(GenerateCount, GivesThatManyObjects) {
  const int objects = GetParam();
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const Scene scene = generated({.objects = objects, .seed = seed});
    EXPECT_EQ(scene.objects.size(), static_cast<std::size_t>(objects) + 1);
    EXPECT_TRUE(validate(scene, "generated"));
  }
}

INSTANTIATE_TEST_SUITE_P(Counts, GenerateCount, testing::Values(0, 1, 15, 25, 40));

TEST(GenerateChapter3, KeepsTheDensityOfTheThesisForMoreObjects) {
  EXPECT_EQ(generated({.objects = 5}).surface.parts[0].size[0], 0.6);
  EXPECT_NEAR(generated({.objects = 40}).surface.parts[0].size[0], 0.6 * std::sqrt(40.0 / 15.0), 1e-12);
  EXPECT_EQ(generated({.objects = 5, .table = 0.8}).surface.parts[0].size, (std::array{0.8, 0.8}));
  EXPECT_EQ(generated({.objects = 5}).robot.q[kJointX], -0.33);
}

TEST(GenerateChapter3, SaysWhenThereIsNoRoomLeft) {
  const auto scene = generate_chapter3({.objects = 40, .table = 0.6});
  ASSERT_FALSE(scene);
  EXPECT_EQ(scene.error().code, Code::kInvalidArgument);
  EXPECT_THAT(scene.error().message, HasSubstr("no free place left for number"));
}

TEST(GenerateChapter3, RefusesImpossibleTables) {
  for (const double table : {0.1, 5.0, -1.0, std::nan("")}) {
    const auto scene = generate_chapter3({.table = table});
    ASSERT_FALSE(scene);
    EXPECT_THAT(scene.error().message, HasSubstr("table: got"));
  }
}

TEST(GenerateChapter3, RefusesImpossibleCounts) {
  for (const int objects : {-1, 41, 1'000'000}) {
    const auto scene = generate_chapter3({.objects = objects});
    ASSERT_FALSE(scene);
    EXPECT_EQ(scene.error().code, Code::kInvalidArgument);
    EXPECT_THAT(scene.error().message, HasSubstr(std::to_string(objects)));
    EXPECT_THAT(scene.error().message, HasSubstr("0 to 40"));
  }
}

}  // namespace
}  // namespace jostle::physics_pool
