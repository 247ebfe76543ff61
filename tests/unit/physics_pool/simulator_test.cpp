// The fine model F against mechanics that one can do by hand.

#include "physics_pool/local/simulator.hpp"
#include "physics_pool/local/engine.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>

#include "physics_pool/scenarios/chapter3.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

constexpr double kGravity = 9.81;
const std::vector<double> kStill{0, 0, 0, 0};

WorldPtr compiled(const Scene& scene) {
  auto world = World::compile(scene);
  if (!world) throw std::runtime_error(world.error().message);
  return std::move(world).value();
}

struct Object {
  double *p, *v;
};

Object object(const World& world, State& x, std::size_t i) {
  const ObjectSlot& slot = world.geometry().layout.objects[i];
  return {&x.q[static_cast<std::size_t>(slot.q)], &x.v[static_cast<std::size_t>(slot.v)]};
}

int steps(const World& world, double seconds) { return static_cast<int>(std::lround(seconds / world.time_step())); }

class SimulatorTest : public testing::Test {
 protected:
  void use(const Scene& scene) {
    world = compiled(scene);
    sut = std::make_unique<Simulator>(world);
    x = initial_state(scene);
  }
  Advance run(const std::vector<double>& u, double seconds) { return sut->advance(x, u, steps(*world, seconds)); }

  WorldPtr world;
  std::unique_ptr<Simulator> sut;
  State x;
};

TEST_F(SimulatorTest, RepeatsBitForBitAfterOtherRollouts) {
  use(*generate_chapter3({.objects = 10, .seed = 4}));
  const State start = x;
  const std::vector<double> push{0.1, 0.01, 0.1, -0.01};
  ASSERT_TRUE(run(push, 1.0).diverged.empty());
  const State first = x;
  ASSERT_NE(first, start);
  // Leave warm starts, warnings and time behind.
  for (const double speed : {-0.1, 0.15}) {
    x = start;
    (void)run({speed, 0.1, -0.5, 0.05}, 0.5);
  }
  x.v.assign(x.v.size(), 1e12);
  EXPECT_FALSE(run(push, 0.1).diverged.empty());
  x = start;
  ASSERT_TRUE(run(push, 1.0).diverged.empty());
  EXPECT_EQ(x, first);
  // And on another simulator of another compilation.
  Simulator other(compiled(world->scene()));
  x = start;
  (void)other.advance(x, push, steps(*world, 1.0));
  EXPECT_EQ(x, first);
}

TEST_F(SimulatorTest, KeepsARestingSceneAtRest) {
  use(*generate_chapter3({.objects = 15, .seed = 2}));
  const State start = x;
  ASSERT_TRUE(run(kStill, 1.0).diverged.empty());
  // Soft contacts let objects sink by micrometres.
  for (std::size_t i = 0; i < x.q.size(); ++i) EXPECT_NEAR(x.q[i], start.q[i], 1e-4);
  for (const double v : x.v) EXPECT_NEAR(v, 0.0, 1e-3);
}

TEST_F(SimulatorTest, LetsObjectsBeyondTheEdgeFallFreely) {
  use(tests::three_objects());
  const Object falling = object(*world, x, 1);
  falling.p[0] = 0.301;  // its centre is just off the surface, its rim still above it
  const double z0 = falling.p[2], t = 0.2;
  ASSERT_TRUE(run(kStill, t).diverged.empty());
  // Euler's method with step h is late by g·h·t/2, here 2 mm of 196 mm.
  const double h = world->time_step();
  EXPECT_NEAR(object(*world, x, 1).p[2], z0 - kGravity * t * t / 2, kGravity * h * t / 2 + 1e-9);
  EXPECT_NEAR(object(*world, x, 1).v[2], -kGravity * t, 1e-9);
  EXPECT_NEAR(object(*world, x, 1).p[0], 0.301, 1e-12);
}

TEST_F(SimulatorTest, CarriesObjectsUpToTheEdge) {
  use(tests::three_objects());
  const Object standing = object(*world, x, 1);
  standing.p[0] = 0.299;
  const double z0 = standing.p[2];
  ASSERT_TRUE(run(kStill, 0.5).diverged.empty());
  EXPECT_NEAR(object(*world, x, 1).p[2], z0, 1e-4);
}

// Two bodies that collide in free fall exchange momentum and lose none.
TEST_F(SimulatorTest, ConservesMomentumInACollisionInTheAir) {
  Scene scene = tests::target_only();
  scene.objects.push_back(tests::box("second", 0.1, 0.1));
  scene.objects[1].mass = 0.3;
  use(scene);
  Object a = object(*world, x, 0), b = object(*world, x, 1);
  a.p[0] = 0.40, a.p[1] = 0.0, a.v[0] = 0.5;
  b.p[0] = 0.46, b.p[1] = 0.01, b.v[0] = -0.5;  // 20 mm apart, off centre
  const double before = 0.5 * 0.5 - 0.3 * 0.5, t = 0.2;
  ASSERT_TRUE(run(kStill, t).diverged.empty());
  a = object(*world, x, 0), b = object(*world, x, 1);
  EXPECT_LT(a.v[0], b.v[0]);  // they did collide
  EXPECT_NEAR(0.5 * a.v[0] + 0.3 * b.v[0], before, 1e-9);
  EXPECT_NEAR(0.5 * a.v[1] + 0.3 * b.v[1], 0.0, 1e-9);
  EXPECT_NEAR(0.5 * a.v[2] + 0.3 * b.v[2], -0.8 * kGravity * t, 1e-9);
}

struct Slide {
  double friction, speed;
};

class SlidingObject : public SimulatorTest, public testing::WithParamInterface<Slide> {};

// v0^2 / (2 mu g). The friction force is the exact Coulomb one while the object
// slides; what differs is Euler's step (v0·h/2) and the soft contact, which
// gives the last creeping millimetre per second: 5 % and half a millimetre.
TEST_P(SlidingObject, StopsAfterTheDistanceOfCoulombFriction) {
  const auto [friction, speed] = GetParam();
  for (const bool round : {false, true}) {
    Scene scene = tests::target_only();
    // Flat, so that it does not rock.
    if (round) scene.objects[0] = tests::cylinder("target", 0, 0);
    scene.objects[0].friction = friction;
    (round ? scene.objects[0].height : scene.objects[0].size[2]) = 0.02;
    use(scene);
    object(*world, x, 0).v[0] = speed;
    ASSERT_TRUE(run(kStill, 2 * speed / (friction * kGravity) + 0.1).diverged.empty());
    const double distance = speed * speed / (2 * friction * kGravity);
    EXPECT_NEAR(object(*world, x, 0).p[0], distance, 0.05 * distance + 5e-4);
    EXPECT_NEAR(object(*world, x, 0).p[1], 0.0, 1e-4);
    EXPECT_NEAR(object(*world, x, 0).v[0], 0.0, 2e-3);
  }
}

INSTANTIATE_TEST_SUITE_P(FrictionAndSpeed, SlidingObject,
                         testing::Values(Slide{0.2, 0.2}, Slide{0.2, 0.6}, Slide{0.4, 0.4}, Slide{0.6, 0.8}));

TEST_F(SimulatorTest, EndsAPushWithTheObjectAtThePalm) {
  Scene scene = tests::target_only();
  scene.robot.q[0] = -0.2;
  use(scene);
  ASSERT_TRUE(run({0.05, 0, 0, 0}, 5.0).diverged.empty());  // from 180 mm to the box at 250 mm
  const double gap = object(*world, x, 0).p[0] - 0.02 - x.q[kJointX];
  EXPECT_NEAR(gap, 0.0, 5e-4);
  EXPECT_GT(object(*world, x, 0).p[0], 0.05);
  EXPECT_NEAR(object(*world, x, 0).p[1], 0.0, 1e-3);
  // From then on it moves as far as the hand, which friction of 2 N against a
  // servo of 2000 N s/m holds back by 1 mm/s.
  const double before = object(*world, x, 0).p[0], hand_before = x.q[kJointX];
  ASSERT_TRUE(run({0.05, 0, 0, 0}, 1.0).diverged.empty());
  EXPECT_NEAR(object(*world, x, 0).p[0] - before, x.q[kJointX] - hand_before, 2e-4);
  EXPECT_NEAR(x.q[kJointX] - hand_before, 0.05, 1.5e-3);
}

TEST_F(SimulatorTest, PushesAWideObjectWithTheFingertips) {
  Scene scene = tests::target_only();
  scene.objects[0].size = {0.04, 0.15, 0.038};
  scene.robot.q[0] = -0.2;
  use(scene);
  ASSERT_TRUE(run({0.05, 0, 0, 0}, 4.0).diverged.empty());
  const double gap = object(*world, x, 0).p[0] - 0.02 - (x.q[kJointX] + kHand.finger_length);
  EXPECT_NEAR(gap, 0.0, 5e-4);
  EXPECT_GT(object(*world, x, 0).p[0], 0.04);
}

TEST_F(SimulatorTest, ReachesTheCommandedVelocityOnEveryAxis) {
  Scene scene = tests::target_only();
  scene.robot = physics_pool::planar_gripper({.x = -0.8, .y = 0.0, .opening = 0.04});
  use(scene);
  ASSERT_TRUE(run({-0.1, 0.08, 0.5, 0.03}, 0.3).diverged.empty());
  EXPECT_NEAR(x.v[kJointX], -0.1, 0.005);
  EXPECT_NEAR(x.v[kJointY], 0.08, 0.004);
  EXPECT_NEAR(x.v[kJointRotation], 0.5, 0.025);
  EXPECT_NEAR(x.v[kJointLeft] + x.v[kJointRight], 0.03, 0.0015);
}

TEST_F(SimulatorTest, MovesAsFarAsVelocityTimesTime) {
  Scene scene = tests::target_only();
  scene.robot = physics_pool::planar_gripper({.x = -0.8, .opening = 0.04});
  use(scene);
  ASSERT_TRUE(run({0.1, -0.1, 0.5, 0}, 1.0).diverged.empty());
  // The servo's time constant of about 10 ms is lost at the start.
  EXPECT_NEAR(x.q[kJointX], -0.7, 0.1 * 0.02);
  EXPECT_NEAR(x.q[kJointY], -0.1, 0.1 * 0.02);
  EXPECT_NEAR(x.q[kJointRotation], 0.5, 0.5 * 0.02);
}

TEST_F(SimulatorTest, StopsTheFingersAtTheirLimits) {
  Scene scene = tests::target_only();
  scene.robot = physics_pool::planar_gripper({.x = -0.8, .opening = 0.04});
  use(scene);
  const State start = x;
  ASSERT_TRUE(run({0, 0, 0, 0.05}, 3.0).diverged.empty());
  EXPECT_NEAR(x.q[kJointLeft], kHand.stroke / 2, 1e-3);
  EXPECT_NEAR(x.q[kJointRight], kHand.stroke / 2, 1e-3);
  x = start;
  ASSERT_TRUE(run({0, 0, 0, -0.05}, 3.0).diverged.empty());
  EXPECT_NEAR(x.q[kJointLeft], 0.0, 1e-3);
  EXPECT_NEAR(x.q[kJointRight], 0.0, 1e-3);
}

TEST_F(SimulatorTest, MovesMirroredWhenEverythingIsMirrored) {
  Scene scene = tests::three_objects();
  scene.robot.q[0] = -0.15;
  scene.objects[2].yaw = 0;
  Scene mirror = scene;
  for (SceneObject& o : mirror.objects) o.y = -o.y;
  use(scene);
  ASSERT_TRUE(run({0.05, 0.1, 0.2, 0}, 0.7).diverged.empty());
  const State a = x;
  use(mirror);
  ASSERT_TRUE(run({0.05, -0.1, -0.2, 0}, 0.7).diverged.empty());
  EXPECT_NEAR(x.q[kJointY], -a.q[kJointY], 1e-6);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto q = static_cast<std::size_t>(world->geometry().layout.objects[i].q);
    EXPECT_NEAR(x.q[q], a.q[q], 1e-4);
    EXPECT_NEAR(x.q[q + 1], -a.q[q + 1], 1e-4);
  }
}

TEST_F(SimulatorTest, StopsAtTheWallsOfAShelf) {
  Scene scene = tests::three_objects();
  scene.fixtures = shelf_walls(scene.surface.parts[0], 0.15);
  use(scene);
  object(*world, x, 1).v[1] = 1.5;  // the can at y = 0.12, fast enough for 0.38 m
  ASSERT_TRUE(run(kStill, 1.0).diverged.empty());
  EXPECT_LT(object(*world, x, 1).p[1], 0.3 - 0.0375 + 2e-3);
  EXPECT_GT(object(*world, x, 1).p[2], 0.02);
}

TEST_F(SimulatorTest, StopsWhenInterrupted) {
  use(tests::target_only());
  int asked = 0;
  const auto result = sut->advance(x, kStill, 100, [&] { return ++asked > 7; });
  EXPECT_TRUE(result.interrupted);
  EXPECT_EQ(result.engine_steps, 7u);
}

class DivergingState : public SimulatorTest {};

TEST_F(DivergingState, IsReportedWithAReason) {
  use(tests::three_objects());
  const State start = x;
  for (const double wild : {1e12, 1e300, std::nan(""), HUGE_VAL}) {
    x = start;
    object(*world, x, 1).v[0] = wild;
    EXPECT_THAT(run(kStill, 0.1).diverged, testing::Not(testing::IsEmpty())) << "velocity " << wild;
    x = start;
    object(*world, x, 1).p[2] = wild;
    EXPECT_THAT(run(kStill, 0.1).diverged, testing::Not(testing::IsEmpty())) << "height " << wild;
  }
  x = start;
  EXPECT_THAT(run(kStill, 0.1).diverged, testing::IsEmpty());
}

TEST_F(DivergingState, WritesNoLogFile) {
  const auto before = std::filesystem::current_path();
  const auto empty = std::filesystem::path(testing::TempDir()) / "jostle_simulator_test";
  std::filesystem::create_directories(empty);
  std::filesystem::current_path(empty);
  use(tests::three_objects());
  object(*world, x, 1).v[0] = 1e12;
  const auto result = run(kStill, 0.1);
  const bool is_empty = std::filesystem::is_empty(empty);
  std::filesystem::current_path(before);
  std::filesystem::remove_all(empty);
  EXPECT_FALSE(result.diverged.empty());
  EXPECT_TRUE(is_empty);
}

TEST(World, HasTheSizesOfItsLayout) {
  const Scene scene = *generate_chapter3({.objects = 15, .seed = 1});
  const WorldPtr world = compiled(scene);
  EXPECT_EQ(world->model()->nq, layout_of(scene).nq);
  EXPECT_EQ(world->model()->nv, layout_of(scene).nv);
  EXPECT_EQ(world->hash(), scene_hash(scene));
  EXPECT_EQ(world->geometry().layout, layout_of(scene));
}

TEST(World, StartsInTheStateOfItsScene) {
  const Scene scene = tests::three_objects();
  const WorldPtr world = compiled(scene);
  const State x = initial_state(scene);
  for (std::size_t i = 5; i < x.q.size(); ++i) {
    EXPECT_NEAR(world->model()->qpos0[i], x.q[i], 1e-12);
  }
}

TEST(World, TakesNamesThatXmlWouldChokeOn) {
  Scene scene = tests::target_only();
  scene.name = "</mujoco>\"&";
  scene.objects[0].name = scene.task.target = "<a & \"b\">";
  EXPECT_TRUE(World::compile(scene));
}

TEST(Separate, LeavesObjectsThatDoNotOverlapWhereTheyAre) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const WorldPtr world = compiled(*generate_chapter3({.objects = 15, .seed = seed}));
    const State x = initial_state(world->scene());
    const State y = separate(*world, x)->x;
    for (std::size_t i = 0; i < x.q.size(); ++i) EXPECT_NEAR(y.q[i], x.q[i], 1e-15);
  }
}

TEST(Separate, ResolvesAnOverlapOf5Millimetres) {
  Scene scene = tests::target_only();
  scene.objects.push_back(tests::box("second", 0.1, 0));
  const WorldPtr world = compiled(scene);
  State x = initial_state(scene);
  Object second = object(*world, x, 1);
  second.p[0] = 0.035;  // two boxes of 40 mm
  State y = separate(*world, x)->x;
  const double apart = object(*world, y, 1).p[0] - object(*world, y, 0).p[0];
  // Its own depth of 0.5 mm, which the engine reports of parallel boxes 1 mm deep.
  EXPECT_GT(apart, 0.04 - 0.0011);
  EXPECT_LT(apart, 0.045);
  // Equal masses share the way.
  EXPECT_NEAR(object(*world, y, 0).p[0] + object(*world, y, 1).p[0], 0.035, 1e-3);
  EXPECT_EQ(y.v, std::vector<double>(x.v.size(), 0.0));
  EXPECT_EQ(toppled_objects(world->geometry(), y, 0.1), 0);
}

TEST(Separate, SaysWhatItCouldNotMoveApart) {
  Scene scene = tests::target_only();
  scene.objects.push_back(tests::box("second", 0.1, 0));
  const WorldPtr world = compiled(scene);
  State x = initial_state(scene);
  object(*world, x, 1).p[0] = 0.01;
  EXPECT_GT(separate(*world, x, 0.0005, 2)->deepest, 0.01);
  EXPECT_LE(separate(*world, x)->deepest, 0.0005);
}

TEST(Separate, IsAnErrorWhereTheEngineDiverges) {
  const WorldPtr world = compiled(tests::three_objects());
  State x = initial_state(world->scene());
  object(*world, x, 1).p[2] = std::nan("");
  const auto result = separate(*world, x);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Code::kInternal);
}

TEST(Separate, LeavesTheRobotInPlaceWhenAnObjectIsInsideIt) {
  const Scene scene = tests::target_only();
  const WorldPtr world = compiled(scene);
  State x = initial_state(scene);
  object(*world, x, 0).p[0] = scene.robot.q[0] + 0.015;  // 5 mm inside the palm
  State y = separate(*world, x)->x;
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(y.q[i], x.q[i]);
  EXPECT_GT(object(*world, y, 0).p[0], scene.robot.q[0] + 0.02 - 0.0006);
}

}  // namespace
}  // namespace jostle::physics_pool
