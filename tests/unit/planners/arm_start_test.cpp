// Plans of an arm that begin where its shadow, a planar gripper, finds a way.

#include "planners/guided/arm_start.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/robot/kinematics.hpp"
#include "physics_pool/scenarios/chapter4.hpp"
#include "planners/approach/straight_reach.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::planners {
namespace {

using namespace tests;
using namespace physics_pool;

Scene shelf() { return generate_chapter4_arm({.objects = 4, .seed = 2}).value(); }

// Keeps what it is asked for.
class Listener final : public Planner {
 public:
  explicit Listener(Problem& heard) : heard_(heard) {}
  Result<Plan> plan(const Problem& problem, TimePoint, std::stop_token) override {
    heard_ = problem;
    return Plan{.controls = problem.initial, .states = {problem.x0}, .cost = 1};
  }

 private:
  Problem& heard_;
};

// Joints after a sequence whose drives follow at once.
std::vector<double> led(const TaskGeometry& geometry, const ControlSequence& controls, std::vector<double> q) {
  for (int t = 0; t < controls.steps(); ++t) {
    for (std::size_t i = 0; i < geometry.robot.axes.size(); ++i) {
      for (const auto& [joint, factor] : geometry.robot.axes[i].joints)
        q[static_cast<std::size_t>(joint)] += factor * controls.step(t)[i] * 0.2;
    }
  }
  return q;
}

TEST(StraightReach, BringsTheTargetBetweenThePads) {
  const Scene scene = shelf();
  const TaskGeometry geometry(scene);
  const State x = initial_state(scene);
  const ControlSequence sut = straight_reach(geometry, x, 5, 0.2);
  ASSERT_EQ(sut.steps(), 5);
  State end = x;
  std::ranges::copy(led(geometry, sut, scene.robot.q), end.q.begin());
  EXPECT_TRUE(in_pre_grasp_region(geometry, end));
  EXPECT_NEAR(tool_pose(geometry, end).translation().z(), tool_pose(geometry, x).translation().z(), 1e-5);
  for (const double u : sut.values) EXPECT_LE(std::abs(u), 4.0);
}

TEST(StraightReach, StandsWhereThereIsNoWayOn) {
  Scene scene = shelf();
  scene.objects.resize(1);
  scene.objects[0].x = 0.2, scene.objects[0].y = 0.3;  // out of the arm's reach
  const TaskGeometry geometry(scene);
  const ControlSequence sut = straight_reach(geometry, initial_state(scene), 5, 0.2);
  for (const double u : sut.step(4)) EXPECT_EQ(u, 0);
}

TEST(Shadow, IsWhereTheHandIs) {
  const Scene scene = shelf();
  const auto sut = shadow_of(scene, scene.robot.q).value();
  EXPECT_TRUE(as_planar(sut.robot.model));
  const Eigen::Isometry3d arm = tool_pose(scene.robot.model, transform(scene.robot.base), scene.robot.q);
  const Eigen::Isometry3d hand = tool_pose(sut.robot.model, transform(sut.robot.base), sut.robot.q);
  EXPECT_NEAR(hand.translation().x(), arm.translation().x(), 1e-9);
  EXPECT_NEAR(hand.translation().y(), arm.translation().y(), 1e-9);
  EXPECT_TRUE(validate(sut, "shadow"));
  EXPECT_FALSE(shadow_of(sut, sut.robot.q));  // a shadow has none
}

TEST(ArmStart, LeadsTheHandWhereItsShadowCame) {
  const Scene scene = shelf();
  const TaskGeometry geometry(scene);
  ThreadPool pool(1);
  Problem heard;
  auto sut = ArmStart::make(pool, scene, geometry, {.rollouts = 2, .step_duration = 0.2},
                            {.candidates = 100, .threads = 1}, std::make_unique<Listener>(heard));
  ASSERT_TRUE(sut) << sut.error().message;
  Problem problem{.world = pool.load(scene).value(), .x0 = initial_state(scene), .iterations = 2, .seed = 3};
  problem.initial = straight_reach(geometry, problem.x0, 5, 0.2);
  const auto plan_result = (*sut)->plan(problem, TimePoint::max());
  ASSERT_TRUE(plan_result) << plan_result.error().message;
  EXPECT_GT(plan_result->rollouts, 0u);  // of the guide
  ASSERT_EQ(heard.initial.steps(), 5);
  EXPECT_EQ(heard.initial.nu, 7);
  EXPECT_EQ(heard.world, problem.world);
  // Level, as high as before, and somewhere into the shelf.
  const auto q = led(geometry, heard.initial, scene.robot.q);
  const Eigen::Isometry3d end = tool_pose(geometry.robot, geometry.base, q);
  EXPECT_NEAR(end.translation().z(), tool_pose(geometry, problem.x0).translation().z(), 1e-3);
  EXPECT_NEAR(end.linear()(2, 2), 1, 1e-3);
  EXPECT_GT(end.translation().x(), tool_pose(geometry, problem.x0).translation().x() + 0.1);
}

TEST(ArmStart, LeavesPlansTowardsAStateAsTheyAre) {
  const Scene scene = shelf();
  const TaskGeometry geometry(scene);
  ThreadPool pool(1);
  Problem heard;
  auto sut = ArmStart::make(pool, scene, geometry, {.step_duration = 0.2}, {.candidates = 100, .threads = 1},
                            std::make_unique<Listener>(heard));
  Problem problem{.world = pool.load(scene).value(), .x0 = initial_state(scene)};
  problem.initial = straight_reach(geometry, problem.x0, 3, 0.2);
  problem.objective["state"].values = problem.x0.q;
  const auto plan_result = (*sut)->plan(problem, TimePoint::max());
  ASSERT_TRUE(plan_result);
  EXPECT_EQ(heard.initial.values, problem.initial.values);
}

}  // namespace
}  // namespace jostle::planners
