#include "physics_pool/coarse/quasi_static_clutter.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "physics_pool/local/simulator.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "tests/support/pushing.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;
using ::testing::HasSubstr;

constexpr double kPusher = 0.0145, kDisc = 0.05115;
constexpr double kGravity = 9.81;  // m/s^2

QuasiStaticClutter model_of(const Scene& scene, const ClutterOptions& options = {}) {
  return std::move(QuasiStaticClutter::make(scene, options)).value();
}

State advanced(const Scene& scene, std::vector<double> u, double duration, const ClutterOptions& options = {}) {
  State x = initial_state(scene);
  model_of(scene, options).advance(x, u, duration);
  return x;
}

ObjectView object(const Scene& scene, const State& x, std::size_t i) {
  static thread_local StateLayout layout;
  layout = layout_of(scene);
  return StateView(layout, x).object(i);
}

TEST(FindTouches, ShortSideAgainstALongOneTouchesWhereTheyFaceEachOther) {
  const Outline shelf{.half_x = 0.5, .half_y = 0.05}, box{.half_x = 0.02, .half_y = 0.02};
  for (const bool box_first : {true, false}) {
    const PlanarPose at_box(0.3, 0.071, 0.0), at_shelf(0.0, 0.0, 0.0);
    const Touches touches = box_first ? find_touches(box, at_box, shelf, at_shelf, 0.005)
                                      : find_touches(shelf, at_shelf, box, at_box, 0.005);
    ASSERT_EQ(touches.count, 2);
    for (const Touch& touch : touches.values) {
      EXPECT_NEAR(touch.gap, 0.001, 1e-12);
      EXPECT_NEAR(touch.normal.y(), box_first ? 1.0 : -1.0, 1e-12);  // towards the first
      EXPECT_NEAR(std::abs(touch.point.x() - 0.3), 0.02, 1e-12);
    }
  }
  EXPECT_EQ(find_touches(box, {0.3, 0.08, 0.0}, shelf, {}, 0.005).count, 0);
}

TEST(QuasiStaticClutter, DiscGoesAlongFromTheTouchOn) {
  const Scene scene = pushing_scene(-0.1, 0.0, {slider_disc("s", 0.0, 0.0)});
  const State x = advanced(scene, {0.05, 0.0}, 2.0);
  EXPECT_NEAR(x.q[0], 0.0, 1e-4);
  EXPECT_NEAR(object(scene, x, 0).position()[0], kPusher + kDisc, 2e-4);
  EXPECT_NEAR(object(scene, x, 0).position()[1], 0.0, 1e-9);
  EXPECT_NEAR(object(scene, x, 0).yaw(), 0.0, 1e-9);
}

TEST(QuasiStaticClutter, CopyMovesWhatTheOriginalMoves) {
  const Scene scene = pushing_scene(-0.1, 0.0, {slider_disc("s", 0.0, 0.0)});
  const QuasiStaticClutter original = model_of(scene);
  QuasiStaticClutter copy = original;
  State x = initial_state(scene);
  copy.advance(x, std::vector<double>{0.05, 0.0}, 2.0);
  EXPECT_EQ(x, advanced(scene, {0.05, 0.0}, 2.0));
  EXPECT_GT(object(scene, x, 0).position()[0], 0.01);
}

// Without friction at the contact the force is along its normal, and the limit surface's normal gives the motion:
// v = u/(1 + b^2/c^2) and omega = v·b/c^2 for a push at distance b from the centre (Lynch 1992).
TEST(QuasiStaticClutter, FrictionlessPushTurnsABoxAsTheLimitSurfaceSays) {
  const double b = 0.03, c = std::hypot(0.109, 0.154) / 2, way = 0.002;
  const Scene scene = pushing_scene(-0.109 / 2 - kPusher, b, {slider_box("s", 0.0, 0.0)});
  const State x = advanced(scene, {way, 0.0}, 1.0, {.step = 1e-4, .weightings = 8, .contact_friction = 0.0});
  const double v = way / (1 + b * b / (c * c));
  EXPECT_NEAR(object(scene, x, 0).position()[0], v, 0.02 * v);
  EXPECT_NEAR(object(scene, x, 0).yaw(), -v * b / (c * c), 0.03 * v * b / (c * c));
}

TEST(QuasiStaticClutter, DriveGivesWayByForceOverGain) {
  Scene scene = target_only();
  scene.robot = planar_gripper({.x = -0.02});  // the palm touches the box
  const SceneObject& box = scene.objects[0];
  const double force = box.friction * box.mass * kGravity;
  const State x = advanced(scene, {0.05, 0.0, 0.0, 0.0}, 1.0);
  EXPECT_NEAR(x.q[0] - scene.robot.q[0], 0.05 - force / 2000.0, 0.1 * force / 2000.0);
  EXPECT_NEAR(object(scene, x, 0).position()[0], 0.05 - force / 2000.0, 2e-4);
}

TEST(QuasiStaticClutter, FingerGivesWayUnlessItIsAtItsEnd) {
  Scene scene = target_only();
  scene.objects[0].y = 0.1;
  scene.robot = planar_gripper({.x = -0.04, .y = 0.1 - 0.02 - 0.0425 - 0.015 - 0.001});  // the box left of the hand
  const State pushed = advanced(scene, {0.0, 0.02, 0.0, 0.0}, 1.0);
  EXPECT_LT(pushed.q[3], 0.0425 - 0.005);                                  // pushed inwards, 100 N s/m against 2 N
  EXPECT_NEAR(pushed.q[4], 0.0425, 1e-9);                                  // the other one touches nothing
  scene.robot = planar_gripper({.x = -0.04, .y = 0.08 + 0.0425 - 0.001});  // the box in the hand
  const State held = advanced(scene, {0.0, 0.02, 0.0, 0.0}, 1.0);
  EXPECT_NEAR(held.q[3], 0.0425, 1e-9);
  EXPECT_NEAR(held.q[4], 0.0425, 1e-6);  // it pushes from inside against its end
  EXPECT_GT(object(scene, held, 0).position()[1], 0.1 + 0.01);
}

TEST(QuasiStaticClutter, PushGoesThroughARowOfObjects) {
  const Scene scene = pushing_scene(-0.07, 0.0, {slider_disc("a", 0.0, 0.0), slider_disc("b", 0.105, 0.0)});
  const State x = advanced(scene, {0.05, 0.0}, 1.0);
  const double a = object(scene, x, 0).position()[0], b = object(scene, x, 1).position()[0];
  EXPECT_NEAR(a, -0.02 + kPusher + kDisc, 1e-3);
  EXPECT_NEAR(b, a + 2 * kDisc, 1e-3);
}

// Not bit for bit: contacts take turns, and a few turns leave them some micrometres from where they would end.
TEST(QuasiStaticClutter, MirroredSceneMovesAsItsMirrorImage) {
  Scene scene = three_objects(), mirrored = scene;
  scene.robot.q[0] = mirrored.robot.q[0] = -0.1;
  for (SceneObject& o : mirrored.objects) o.y = -o.y, o.yaw = -o.yaw;
  const State x = advanced(scene, {0.12, 0.05, 0.2, -0.005}, 1.0);
  const State y = advanced(mirrored, {0.12, -0.05, -0.2, -0.005}, 1.0);
  EXPECT_NEAR(x.q[1], -y.q[1], 1e-6);
  EXPECT_NEAR(x.q[3], y.q[4], 1e-6);
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    EXPECT_NEAR(object(scene, x, i).position()[0], object(mirrored, y, i).position()[0], 1e-4) << i;
    EXPECT_NEAR(object(scene, x, i).position()[1], -object(mirrored, y, i).position()[1], 1e-4) << i;
    EXPECT_NEAR(object(scene, x, i).yaw(), -object(mirrored, y, i).yaw(), 1e-4) << i;
  }
  EXPECT_GT(std::abs(object(scene, x, 0).position()[0]), 0.01);
}

TEST(QuasiStaticClutter, WhatIsNotTouchedStaysBitForBit) {
  const Scene scene = three_objects();
  const State x0 = initial_state(scene), x = advanced(scene, {0.1, 0.0, 0.1, 0.0}, 1.0);
  EXPECT_TRUE(std::equal(x.q.begin() + 5, x.q.end(), x0.q.begin() + 5));
}

TEST(QuasiStaticClutter, ObjectThatLeavesTheSurfaceFallsAndIsOutOfTheWay) {
  Scene scene = target_only();
  scene.objects[0].x = 0.26;
  scene.robot = planar_gripper({.x = 0.23});
  const State x = advanced(scene, {0.1, 0.0, 0.0, 0.0}, 1.0);
  EXPECT_LT(object(scene, x, 0).position()[2], scene.objects[0].rest_height() - 0.1);
  EXPECT_NEAR(object(scene, x, 0).position()[0], 0.3, 0.01);
  State again = x;
  model_of(scene).advance(again, std::vector{0.1, 0.0, 0.0, 0.0}, 1.0);
  EXPECT_EQ(object(scene, again, 0).position()[0], object(scene, x, 0).position()[0]);
}

TEST(QuasiStaticClutter, FixtureStopsWhatIsPushedAgainstItAndTheHandBehind) {
  Scene scene = target_only();
  scene.robot = planar_gripper({.x = -0.03});
  scene.fixtures = {{.name = "wall", .size = {0.02, 0.4, 0.1}, .pose = {.position = {0.06, 0.0, 0.05}}}};
  const State x = advanced(scene, {0.1, 0.0, 0.0, 0.0}, 1.0);
  // The fingers, 70 mm long, or the box, 40 mm, meet the wall's face at 50 mm.
  EXPECT_LT(x.q[0] + 0.07, 0.05 + 0.002);
  EXPECT_LT(object(scene, x, 0).position()[0] + 0.02, 0.05 + 0.002);
}

TEST(QuasiStaticClutter, IsAPureFunctionOfStateAndControl) {
  const Scene scene = std::move(generate_chapter3({.objects = 15, .seed = 3})).value();
  QuasiStaticClutter used = model_of(scene);
  const std::vector<double> u{0.08, 0.02, 0.1, 0.0};
  State x = initial_state(scene);
  for (int t = 0; t < 5; ++t) {
    State y = x;
    model_of(scene).advance(y, u, 1.0);
    used.advance(x, u, 1.0);
    EXPECT_EQ(x, y) << t;
  }
}

TEST(QuasiStaticClutter, NumbersThatAreNotFiniteComeOutAndEnd) {
  const Scene scene = three_objects();
  const State x = advanced(scene, {std::numeric_limits<double>::quiet_NaN(), 0.0, 0.0, 0.0}, 1.0);
  EXPECT_FALSE(std::isfinite(x.q[0]));
}

TEST(QuasiStaticClutter, RefusesWhatThePlaneCannotShow) {
  Scene scene = target_only();
  scene.robot.model.joints[2].axis = {0, 1, 0};
  const auto result = QuasiStaticClutter::make(scene);
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr("gripper_rotation"));
}

// One control step from the engine's own state.
TEST(QuasiStaticClutter, OneStepIsNearTheFineModels) {
  std::vector<double> errors, ways, hand;
  for (std::uint64_t seed = 101; seed <= 102; ++seed) {
    const Scene scene = std::move(generate_chapter3({.objects = 15, .seed = seed})).value();
    Simulator fine(std::move(World::compile(scene)).value());
    QuasiStaticClutter sut = model_of(scene);
    CounterStream random(9, static_cast<std::uint32_t>(seed));
    State x = initial_state(scene);
    for (int t = 0; t < 6; ++t) {
      const std::vector<double> u{random.normal(0.06, 0.02), random.normal(0, 0.03), random.normal(0, 0.15), 0.0};
      State coarse = x;
      const State before = x;
      sut.advance(coarse, u, 1.0);
      (void)fine.advance(x, u, 500);
      hand.push_back(std::hypot(coarse.q[0] - x.q[0], coarse.q[1] - x.q[1]));
      for (std::size_t i = 0; i < scene.objects.size(); ++i) {
        const auto* was = object(scene, before, i).position();
        const auto* is = object(scene, x, i).position();
        const double way = std::hypot(is[0] - was[0], is[1] - was[1]);
        if (way < 0.001) continue;
        const auto* guess = object(scene, coarse, i).position();
        ways.push_back(way);
        errors.push_back(std::hypot(guess[0] - is[0], guess[1] - is[1]));
      }
    }
  }
  const auto quantile = [](std::vector<double> values, double q) {
    std::ranges::sort(values);
    return values[static_cast<std::size_t>(q * static_cast<double>(values.size() - 1))];
  };
  ASSERT_GT(errors.size(), 15u);
  EXPECT_GT(quantile(ways, 0.5), 0.015);
  EXPECT_LT(quantile(errors, 0.5), 0.004);
  EXPECT_LT(quantile(errors, 0.9), 0.016);
  EXPECT_LT(quantile(hand, 0.9), 0.002);
}

}  // namespace
}  // namespace jostle::physics_pool
