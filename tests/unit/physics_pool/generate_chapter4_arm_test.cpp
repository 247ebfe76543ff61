// Shelves for an arm, and what stands in them.

#include <gmock/gmock.h>

#include <cmath>
#include <set>

#include "physics_pool/local/simulator.hpp"
#include "physics_pool/robot/inverse_kinematics.hpp"
#include "physics_pool/robot/kinematics.hpp"
#include "physics_pool/scenarios/chapter4.hpp"
#include "physics_pool/scenarios/household.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::physics_pool {
namespace {

Scene shelf(std::uint64_t seed, int objects = 9) {
  auto result = generate_chapter4_arm({.objects = objects, .seed = seed});
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(result).value();
}

Eigen::Isometry3d hand_at(double x, double y, double z, double yaw) {
  return Eigen::Translation3d(x, y, z) * Eigen::Isometry3d(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
}

// Controls that bring a scene's hand to poses in turn, 0.2 s for each.
ControlSequence along(const Scene& scene, const std::vector<Eigen::Isometry3d>& poses) {
  ControlSequence controls{.nu = 7};
  std::vector<double> q = scene.robot.q;
  for (const Eigen::Isometry3d& pose : poses) {
    const auto next = joints_at(scene.robot.model, transform(scene.robot.base), pose, q);
    if (!next) throw std::runtime_error("out of reach");
    for (std::size_t j = 0; j < 6; ++j) controls.values.push_back(((*next)[j] - q[j]) / 0.2);
    controls.values.push_back(0.0);
    q = *next;
  }
  return controls;
}

TEST(GenerateChapter4Arm, MakesValidShelvesWithThingsOfAKitchen) {
  std::set<std::string> things;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Scene sut = shelf(seed);
    const auto valid = validate(sut, "shelf");
    ASSERT_TRUE(valid) << valid.error().message;
    EXPECT_EQ(sut.objects.size(), 10u);
    EXPECT_EQ(sut.robot.model.axes.size(), 7u);
    EXPECT_TRUE(std::ranges::any_of(sut.objects, [](const SceneObject& o) { return o.parts.size() == 8; }));  // a bowl
    EXPECT_TRUE(std::ranges::any_of(sut.objects, [](const SceneObject& o) { return o.parts.size() == 1; }));  // a mug
    for (const SceneObject& object : sut.objects) {
      things.insert(object.name.substr(0, object.name.rfind('_')));
      EXPECT_TRUE(object.friction >= 0.2 && object.friction <= 0.4);
      EXPECT_LT(object.top(), 0.4);
    }
  }
  EXPECT_GE(things.size(), 9u);
}

// The engine agrees that nothing starts in anything else, the arm included.
TEST(GenerateChapter4Arm, CanBeSimulated) {
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    const auto world_result = World::compile(shelf(seed));
    EXPECT_TRUE(world_result) << world_result.error().message;
  }
}

TEST(GenerateChapter4Arm, PutsTwoObjectsOnTheStraightWayToTheTarget) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Scene sut = shelf(seed);
    const Eigen::Vector3d hand = tool_pose(sut.robot.model, transform(sut.robot.base), sut.robot.q).translation();
    const SceneObject& target = sut.objects[0];
    const double dx = target.x - hand.x(), dy = target.y - hand.y(), way = std::hypot(dx, dy);
    int in_the_way = 0;
    for (std::size_t i = 1; i < sut.objects.size(); ++i) {
      const double x = sut.objects[i].x - hand.x(), y = sut.objects[i].y - hand.y();
      const double ahead = (x * dx + y * dy) / way, beside = std::abs(x * dy - y * dx) / way;
      if (ahead < way && beside <= 0.02 + 1e-9) ++in_the_way;
    }
    EXPECT_GE(in_the_way, 2) << "seed " << seed;
  }
}

// What kinematics promised, the engine does: in the empty shelf the hand comes to the target, and no link to a board.
TEST(GenerateChapter4Arm, IsReachable) {
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    Scene scene = shelf(seed);
    ASSERT_TRUE(is_reachable(scene));
    scene.objects.resize(1);
    const SceneObject& target = scene.objects[0];
    const auto world = World::compile(scene).value();
    const Eigen::Isometry3d from = tool_pose(scene.robot.model, transform(scene.robot.base), scene.robot.q);
    Eigen::Vector3d way(target.x - from.translation().x(), target.y - from.translation().y(), 0);
    way *= 1 - scene.robot.model.hand->depth / way.norm();
    std::vector<Eigen::Isometry3d> poses(10, from);
    for (std::size_t i = 0; i < poses.size(); ++i) poses[i].translation() += 0.1 * static_cast<double>(i + 1) * way;
    const ControlSequence controls = along(scene, poses);
    Simulator simulator(world);
    State x = initial_state(scene);
    for (int t = 0; t < controls.steps(); ++t) {
      const Advance advance = simulator.advance(x, controls.step(t), 100);
      EXPECT_EQ(advance.diverged, "");
      EXPECT_FALSE(advance.facts.robot_hit_fixture) << "seed " << seed << ", step " << t;
    }
    EXPECT_TRUE(in_pre_grasp_region(world->geometry(), x)) << "seed " << seed;
  }
}

TEST(GenerateChapter4Arm, TellsWhatIsOutOfReach) {
  Scene scene = shelf(1);
  scene.objects.resize(1);
  scene.objects[0].x = 0.21, scene.objects[0].y = 0.36;
  EXPECT_FALSE(is_reachable(scene));
}

TEST(GenerateChapter4Arm, GivesEqualScenesForEqualSeeds) {
  EXPECT_EQ(scene_hash(shelf(3)), scene_hash(shelf(3)));
  EXPECT_NE(scene_hash(shelf(3)), scene_hash(shelf(4)));
}

TEST(GenerateChapter4Arm, RefusesWhatHasNoRoom) {
  EXPECT_FALSE(generate_chapter4_arm({.objects = 1}));
  EXPECT_FALSE(generate_chapter4_arm({.objects = 16}));
}

TEST(JointsAt, BringTheHandWhereItIsWanted) {
  const Scene scene = shelf(1);
  const Eigen::Isometry3d base = transform(scene.robot.base);
  for (const Eigen::Isometry3d& wanted : {hand_at(-0.3, 0.1, 0.1, 0.4), hand_at(0.05, -0.15, 0.08, -0.3)}) {
    const auto q = joints_at(scene.robot.model, base, wanted, scene.robot.q);
    ASSERT_TRUE(q);
    EXPECT_LT((tool_pose(scene.robot.model, base, *q).matrix() - wanted.matrix()).norm(), 1e-5);
    EXPECT_EQ((*q)[6], scene.robot.q[6]);  // fingers stay
  }
}

TEST(JointsAt, FindNoneOutOfReach) {
  const Scene scene = shelf(1);
  EXPECT_FALSE(joints_at(scene.robot.model, transform(scene.robot.base), hand_at(0.6, 0, 0.1, 0), scene.robot.q));
}

}  // namespace
}  // namespace jostle::physics_pool
