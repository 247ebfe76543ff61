// The fine model F of pushing (Sec. 6.1) against what symmetry and geometry say.

#include <gmock/gmock.h>

#include <cmath>

#include "physics_pool/local/simulator.hpp"
#include "physics_pool/scenarios/push.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

// Advances a fresh simulator by one action, x[1] = F(x[0], u, seconds).
State pushed(const Scene& scene, State x, const std::vector<double>& u, double seconds) {
  auto world = World::compile(scene);
  if (!world) throw std::runtime_error(world.error().message);
  Simulator simulator(*world);
  const Advance advance = simulator.advance(x, u, static_cast<int>(std::lround(seconds / scene.physics.time_step)));
  EXPECT_EQ(advance.diverged, "");
  return x;
}

class Pusher : public testing::TestWithParam<const char*> {
 protected:
  Pusher() { scene.physics.integrator = GetParam(); }

  const double* target(const State& x) const { return &x.q[static_cast<std::size_t>(layout_of(scene).objects[0].q)]; }

  Scene scene = tests::push_ahead();
};

TEST_P(Pusher, GoesWhereItIsToldWhenItMeetsNothing) {
  const State x = pushed(scene, initial_state(scene), {-0.06, 0.08}, 1.0);
  EXPECT_NEAR(x.q[kJointX], scene.robot.q[0] - 0.06, 5e-4);  // up to speed within 4 ms
  EXPECT_NEAR(x.q[kJointY], scene.robot.q[1] + 0.08, 5e-4);
}

TEST_P(Pusher, KeepsItsSpeedWhenItPushes) {
  const State x = pushed(scene, initial_state(scene), {0.1, 0.0}, 2.0);
  EXPECT_NEAR(x.v[kJointX], 0.1, 1e-3);
  EXPECT_NEAR(x.q[kJointX], scene.robot.q[0] + 0.2, 1e-3);
}

TEST_P(Pusher, PushesACentredCylinderStraightAhead) {
  const State x = pushed(scene, initial_state(scene), {0.1, 0.0}, 2.0);
  const double* p = target(x);
  // An unstable balance, upset by how the engine places contact points: 0.1 mm with
  // euler and 3 mm with rk4 were measured after 19 cm.
  EXPECT_NEAR(p[1], 0.0, 5e-3);
  // In contact, half a millimetre of give and take.
  EXPECT_NEAR(p[0] - x.q[kJointX], 0.05115 + 0.0145, 1e-3);
  EXPECT_GT(p[0], -0.2 + 0.15);
}

TEST_P(Pusher, SymmetricPushesMirror) {
  scene.robot.q[1] = 0.02;  // off centre
  const State left = pushed(scene, initial_state(scene), {0.1, -0.01}, 1.5);
  scene.robot.q[1] = -0.02;
  const State right = pushed(scene, initial_state(scene), {0.1, 0.01}, 1.5);
  EXPECT_NEAR(target(left)[0], target(right)[0], 1e-3);
  EXPECT_NEAR(target(left)[1], -target(right)[1], 1e-3);
  EXPECT_LT(target(left)[1], -0.005);  // pushed on its left it goes right
}

TEST_P(Pusher, LeavesWhatItDoesNotTouchAlone) {
  const State start = initial_state(scene);
  const State x = pushed(scene, start, {-0.1, 0.0}, 1.0);
  EXPECT_NEAR(target(x)[0], target(start)[0], 1e-5);
  EXPECT_NEAR(target(x)[1], target(start)[1], 1e-5);
}

TEST_P(Pusher, PassesOverTheObstacle) {
  Scene around = tests::push_around();
  around.physics.integrator = GetParam();
  const State x = pushed(around, initial_state(around), {0.1, 0.0}, 3.0);
  EXPECT_NEAR(x.q[kJointX], around.robot.q[0] + 0.3, 1e-3);  // a keep-out area, not a body
  EXPECT_TRUE(target_hits_obstacle(TaskGeometry(around), x));
}

INSTANTIATE_TEST_SUITE_P(Integrators, Pusher, testing::Values("euler", "rk4"),
                         [](const auto& param) { return std::string(param.param); });

// Turned by a right angle everything happens as before, turned by a right angle.
TEST(PusherFrames, PushesAlikeInEveryDirection) {
  Scene scene = tests::push_ahead();
  scene.robot.q[1] = 0.015;
  const State along_x = pushed(scene, initial_state(scene), {0.1, 0.0}, 1.5);
  Scene turned = scene;
  turned.robot.q[0] = -scene.robot.q[1];
  turned.robot.q[1] = scene.robot.q[0];
  turned.objects[0].x = -scene.objects[0].y;
  turned.objects[0].y = scene.objects[0].x;
  const State along_y = pushed(turned, initial_state(turned), {0.0, 0.1}, 1.5);
  const auto q = static_cast<std::size_t>(layout_of(scene).objects[0].q);
  EXPECT_NEAR(along_y.q[q], -along_x.q[q + 1], 1e-3);
  EXPECT_NEAR(along_y.q[q + 1], along_x.q[q], 1e-3);
}

}  // namespace
}  // namespace jostle::physics_pool
