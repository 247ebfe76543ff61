#include "physics_pool/scenarios/chapter4.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "physics_pool/local/world.hpp"

namespace jostle::physics_pool {
namespace {

Scene shelf(std::uint64_t seed) {
  auto result = generate_chapter4({.seed = seed});
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(result).value();
}

TEST(GenerateChapter4, MakesValidShelvesOfTenObjects) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Scene sut = shelf(seed);
    EXPECT_EQ(sut.objects.size(), 10u);
    EXPECT_EQ(sut.fixtures.size(), 3u);
    const auto valid = validate(sut, "shelf");
    EXPECT_TRUE(valid) << valid.error().message;
    for (const SceneObject& object : sut.objects) {
      EXPECT_TRUE(object.mass >= 0.5 && object.mass <= 0.8);
      EXPECT_TRUE(object.friction >= 0.2 && object.friction <= 0.4);
    }
  }
  EXPECT_TRUE(World::compile(shelf(1)));
}

TEST(GenerateChapter4, PutsTwoObjectsOnTheStraightWayToTheTarget) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    const Scene sut = shelf(seed);
    const SceneObject& target = sut.objects[0];
    const double dx = target.x + 0.33, dy = target.y, way = std::hypot(dx, dy);
    int in_the_way = 0;
    for (std::size_t i = 1; i < sut.objects.size(); ++i) {
      const double x = sut.objects[i].x + 0.33, y = sut.objects[i].y;
      const double along = (x * dx + y * dy) / way, beside = std::abs(x * dy - y * dx) / way;
      if (along < way && beside <= 0.02 + 1e-9) ++in_the_way;
    }
    EXPECT_GE(in_the_way, 2) << "seed " << seed;
  }
}

TEST(GenerateChapter4, GivesEqualScenesForEqualSeeds) {
  EXPECT_EQ(scene_hash(shelf(3)), scene_hash(shelf(3)));
  EXPECT_NE(scene_hash(shelf(3)), scene_hash(shelf(4)));
}

TEST(GenerateChapter4, RefusesWhatHasNoRoom) {
  EXPECT_FALSE(generate_chapter4({.objects = 1}));
  EXPECT_FALSE(generate_chapter4({.objects = 16}));
}

}  // namespace
}  // namespace jostle::physics_pool
