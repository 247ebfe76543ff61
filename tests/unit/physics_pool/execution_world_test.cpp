#include "physics_pool/local/execution_world.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "physics_pool/local/rollout.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

constexpr int kSteps = 250;  // half a second

WorldPtr compiled() {
  Scene scene = tests::three_objects();
  scene.robot.q[0] = -0.15;
  return std::move(World::compile(scene)).value();
}

State after(ExecutionWorld& sut, const std::vector<double>& u, int steps = kSteps) {
  sut.begin(u);
  for (int i = 0; i < steps; ++i) {
    const auto ok = sut.step();
    if (!ok) ADD_FAILURE() << ok.error().message;
  }
  return sut.state();
}

TEST(ExecutionWorld, EndsActionsBitEqualToThePlannersModelWithoutNoise) {
  const WorldPtr world = compiled();
  ExecutionWorld sut(world);
  Simulator model(world);
  State x = initial_state(world->scene());
  EXPECT_EQ(sut.state(), x);
  for (const std::vector<double>& u : {std::vector<double>{0.1, 0.1, 0.3, 0}, {0.05, -0.1, 0, -0.02}}) {
    (void)model.advance(x, u, kSteps);
    EXPECT_EQ(after(sut, u), x);
  }
  EXPECT_NEAR(sut.time(), 2 * kSteps * world->time_step(), 1e-12);
}

TEST(ExecutionWorld, RepeatsForEqualSeedsAndDiffersForOthers) {
  const WorldPtr world = compiled();
  const std::vector<double> u{0.1, 0.1, 0.3, 0};
  ExecutionWorld a(world, {.sigma = 0.003, .seed = 1}), b(world, {.sigma = 0.003, .seed = 1}),
      c(world, {.sigma = 0.003, .seed = 2});
  const State x = after(a, u);
  EXPECT_EQ(after(b, u), x);
  EXPECT_NE(after(c, u), x);
}

// Eq. 3.3: a robot at rest has, after one step, a velocity of one draw.
TEST(ExecutionWorld, AddsVelocityNoiseOfTheGivenSigmaEveryStep) {
  Scene scene = tests::target_only();
  scene.robot = physics_pool::planar_gripper({.x = -0.8});
  const WorldPtr world = std::move(World::compile(scene)).value();
  constexpr double kSigma = 0.01;
  constexpr int kRuns = 400;
  double square = 0;
  for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
    ExecutionWorld sut(world, {.sigma = kSigma, .seed = seed});
    (void)after(sut, {0, 0, 0, 0}, 1);
    square += std::pow(sut.state().v[kJointX], 2);
  }
  EXPECT_NEAR(std::sqrt(square / kRuns) / kSigma, 1.0, 5 / std::sqrt(2.0 * kRuns));
}

// Eq. 5.10, read as a standard deviation: 0.5·|u| with a hand that turns at 0.3 rad/s counted as 0.03 m/s.
TEST(ExecutionWorld, AddsVelocityNoiseInProportionToTheControl) {
  Scene scene = tests::target_only();
  scene.robot = physics_pool::planar_gripper({.x = -0.8});
  const WorldPtr world = std::move(World::compile(scene)).value();
  constexpr int kRuns = 400;
  const std::vector<double> u{0.04, 0, 0.3, 0};
  ExecutionWorld quiet(world);
  const double without = after(quiet, u, 1).v[kJointY];
  double square = 0;
  for (std::uint64_t seed = 0; seed < kRuns; ++seed) {
    ExecutionWorld sut(world, {.slope = 0.5, .seed = seed});
    square += std::pow(after(sut, u, 1).v[kJointY] - without, 2);
  }
  EXPECT_NEAR(std::sqrt(square / kRuns) / (0.5 * 0.05), 1.0, 5 / std::sqrt(2.0 * kRuns));
}

// Both are N(0, s^2) after every step of the same physics; the numbers are others, or a planner would foretell the
// world.
TEST(ExecutionWorld, AndThePlannersModelAreDisturbedAlikeByOtherNumbers) {
  const WorldPtr world = compiled();
  const VelocityNoise noise{.sigma = 0.003, .seed = 1};
  ExecutionWorld sut(world, noise);
  Simulator model(world);
  State x = initial_state(world->scene());
  const std::vector<double> u{0.1, 0.1, 0.3, 0};
  (void)model.advance(x, u, kSteps, {}, {.noise = noise, .stream = {.purpose = Purpose::kExecutedNoise}});
  EXPECT_EQ(after(sut, u), x);
  State y = initial_state(world->scene());
  (void)model.advance(y, u, kSteps, {}, {.noise = noise});
  EXPECT_NE(y, x);
}

// A rollout may be cut at any control step and go on elsewhere.
TEST(Disturbance, IsDrawnByTheStepOfTheWholeRollout) {
  const WorldPtr world = compiled();
  const VelocityNoise noise{.sigma = 0.003, .seed = 1};
  const std::vector<double> u{0.1, 0.1, 0.3, 0};
  Simulator whole(world), cut(world);
  State x = initial_state(world->scene()), y = x;
  (void)whole.advance(x, u, kSteps, {}, {.noise = noise});
  (void)whole.advance(x, u, kSteps, {}, {.noise = noise, .first_step = kSteps});
  (void)cut.advance(y, u, kSteps, {}, {.noise = noise});
  Simulator elsewhere(world);
  (void)elsewhere.advance(y, u, kSteps, {}, {.noise = noise, .first_step = kSteps});
  EXPECT_EQ(x, y);
}

// Sec. 5.2: noise that grows with the control is silent while a rollout rests, and counts on all the same.
TEST(Rest, OfARolloutIsAnActionWithoutControlsInTheWorld) {
  const WorldPtr world = compiled();
  const double h = world->time_step();
  const int rest = 60;
  const std::vector<double> u{0.1, 0.1, 0.3, 0}, none(4, 0.0);
  for (const VelocityNoise& noise : {VelocityNoise{}, VelocityNoise{.slope = 0.05, .seed = 3}}) {
    RolloutBatch batch{.world = world->hash(), .x0 = initial_state(world->scene()), .u_before = none};
    for (int t = 0; t < 2; ++t) batch.nominal.append(u);
    batch.law = {.sigma = none, .limit = std::vector<double>(4, 1.0)};
    batch.step_duration = kSteps * h;
    batch.rest = rest * h;
    batch.noise = noise;
    Simulator model(world), same(world);
    BatchSignals signals;
    const RolloutOutcome outcome = run_rollout(model, batch, 0, signals);
    ASSERT_EQ(outcome.end, End::kCompleted);
    EXPECT_EQ(outcome.engine_steps, 2u * (kSteps + rest));
    State x = batch.x0;
    std::uint64_t done = 0;
    for (int t = 0; t < 2; ++t) {
      for (const auto& [control, steps] : {std::pair(u, kSteps), {none, rest}}) {
        (void)same.advance(x, control, steps, {}, {.noise = noise, .first_step = done});
        done += static_cast<std::uint64_t>(steps);
      }
      EXPECT_EQ(outcome.trajectory[static_cast<std::size_t>(t) + 1], x);
    }
    if (!noise.is_off()) continue;
    ExecutionWorld truth(world);
    for (int t = 0; t < 2; ++t) {
      after(truth, u);
      truth.begin(none);
      for (int i = 0; i < rest; ++i) ASSERT_TRUE(truth.step());
    }
    EXPECT_EQ(truth.state(), x);
  }
}

TEST(ExecutionWorld, StaysNearTheQuietWorldWhenNoiseIsSmall) {
  const WorldPtr world = compiled();
  ExecutionWorld quiet(world), noisy(world, {.sigma = 1e-6, .seed = 1});
  const State a = after(quiet, {0, 0, 0, 0}), b = after(noisy, {0, 0, 0, 0});
  EXPECT_NE(a, b);
  for (std::size_t i = 0; i < a.q.size(); ++i) EXPECT_NEAR(a.q[i], b.q[i], 1e-4);
}

TEST(ExecutionWorld, ReportsDivergenceAsAnError) {
  ExecutionWorld sut(compiled(), {.sigma = 1e12, .seed = 1});
  sut.begin(std::vector<double>{0, 0, 0, 0});
  Result<void> ok;
  for (int i = 0; i < 5 && ok; ++i) ok = sut.step();
  ASSERT_FALSE(ok);
  EXPECT_THAT(ok.error().message, testing::HasSubstr("diverged"));
}

}  // namespace
}  // namespace jostle::physics_pool
