#include "physics_pool/local/rollout.hpp"

#include <gmock/gmock.h>

#include <numeric>

#include "physics_pool/local/simulator.hpp"
#include "tests/support/costs.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

class RolloutTest : public testing::Test {
 protected:
  RolloutTest() {
    Scene scene = tests::three_objects();
    scene.robot.q[0] = -0.2;
    world = std::move(World::compile(scene)).value();
    sut = std::make_unique<Simulator>(world);
    batch.world = world->hash();
    batch.x0 = initial_state(scene);
    for (int t = 0; t < 4; ++t) batch.nominal.append(std::vector<double>{0.1, 0.02 * t, 0.1, 0.0});
    batch.u_before = {0, 0, 0, 0};
    batch.step_duration = 0.4;
    batch.law = {.sigma = {0.02, 0.02, 0.1, 0.01}, .limit = {0.15, 0.15, 0.8, 0.05}, .seed = 3};
    batch.objective.success_cost = 0;  // nothing succeeds unless a test says so
  }

  RolloutOutcome run(std::uint32_t sample = 0) {
    BatchSignals signals;
    return run_rollout(*sut, batch, sample, signals);
  }

  // One rollout that ends with the target in the hand.
  void aim_at_target() {
    batch.law.sigma = {0, 0, 0, 0};
    batch.nominal.values.clear();
    for (int t = 0; t < 8; ++t) batch.nominal.append(std::vector<double>{0.1, 0, 0, 0});
    batch.objective.success_cost = 1e9;
    batch.stop_on_success = true;
  }

  WorldPtr world;
  std::unique_ptr<Simulator> sut;
  RolloutBatch batch;
};

TEST_F(RolloutTest, FollowsFAndScoresEveryStep) {
  const RolloutOutcome outcome = run(5);
  ASSERT_EQ(outcome.end, End::kCompleted);
  ASSERT_EQ(outcome.trajectory.size(), 5u);
  ASSERT_EQ(outcome.step_costs.size(), 4u);
  EXPECT_EQ(outcome.sample, 5u);
  EXPECT_EQ(outcome.steps, 4u);
  EXPECT_EQ(outcome.engine_steps, 4u * 200u);
  const ControlSequence controls = sample_controls(batch.nominal, batch.law, 5);
  State x = batch.x0;
  std::vector<double> u_before = batch.u_before;
  double total = 0;
  for (int t = 0; t < 4; ++t) {
    const State before = x;
    (void)sut->advance(x, controls.step(t), 200);
    EXPECT_EQ(outcome.trajectory[std::size_t(t) + 1], x);
    double cost = tests::running_cost(world->geometry(), batch.objective, u_before, controls.step(t), before, x);
    if (t == 3)
      cost += batch.objective.weight("goal") *
              tests::goal_cost(world->geometry(), x, batch.objective.value("goal", "angle"));
    EXPECT_DOUBLE_EQ(outcome.step_costs[std::size_t(t)], cost);
    total += cost;
    u_before.assign(controls.step(t).begin(), controls.step(t).end());
  }
  EXPECT_NEAR(outcome.cost, total, 1e-9 * total);
}

TEST_F(RolloutTest, RepeatsBitForBit) {
  const RolloutOutcome first = run(2);
  (void)run(3);
  const RolloutOutcome second = run(2);
  EXPECT_EQ(first.cost, second.cost);
  EXPECT_EQ(first.trajectory, second.trajectory);
}

TEST_F(RolloutTest, StopsWhenTheIncumbentCannotBeBeaten) {
  const double cost = run().cost;
  const double after_one = run().step_costs[0];
  batch.incumbent = after_one;
  const RolloutOutcome lost = run();
  EXPECT_EQ(lost.end, End::kLost);
  EXPECT_EQ(lost.steps, 1u);
  EXPECT_EQ(lost.cost, kInfinity);
  EXPECT_THAT(lost.trajectory, testing::IsEmpty());
  batch.incumbent = std::nextafter(cost, kInfinity);
  EXPECT_EQ(run().end, End::kCompleted);
}

TEST_F(RolloutTest, RunsToItsEndWhenLosersMayNotStop) {
  batch.incumbent = 1e-6;
  batch.stop_losers = false;
  const RolloutOutcome outcome = run();
  EXPECT_EQ(outcome.end, End::kCompleted);
  EXPECT_EQ(outcome.steps, 4u);
}

TEST_F(RolloutTest, StopsWhenASiblingIsAlreadyBetter) {
  BatchSignals signals;
  signals.offer_cost(run().step_costs[0] / 2);
  EXPECT_EQ(run_rollout(*sut, batch, 0, signals).end, End::kLost);
}

TEST_F(RolloutTest, TellsItsSiblingsItsCost) {
  BatchSignals signals;
  const RolloutOutcome outcome = run_rollout(*sut, batch, 0, signals);
  EXPECT_EQ(signals.best(), outcome.cost);
}

TEST_F(RolloutTest, IsSkippedOnceALowerIndexSucceeded) {
  BatchSignals signals;
  signals.offer_success(4);
  EXPECT_EQ(run_rollout(*sut, batch, 5, signals).end, End::kSkipped);
  EXPECT_EQ(run_rollout(*sut, batch, 3, signals).end, End::kCompleted);
}

TEST_F(RolloutTest, IsSkippedOnceTheBatchIsCancelled) {
  BatchSignals signals;
  signals.cancel();
  const RolloutOutcome outcome = run_rollout(*sut, batch, 0, signals);
  EXPECT_EQ(outcome.end, End::kSkipped);
  EXPECT_EQ(outcome.engine_steps, 0u);
}

TEST_F(RolloutTest, SucceedsWhenTheTargetIsInTheHandAndTellsItsSiblings) {
  aim_at_target();
  BatchSignals signals;
  const RolloutOutcome outcome = run_rollout(*sut, batch, 7, signals);
  ASSERT_EQ(outcome.end, End::kSucceeded);
  EXPECT_LT(outcome.steps, 8u);
  EXPECT_TRUE(outcome.at_goal);
  EXPECT_TRUE(at_goal(world->geometry(), outcome.trajectory.back(), batch.objective));
  EXPECT_EQ(outcome.trajectory.size(), outcome.steps + 1u);
  EXPECT_NEAR(outcome.cost, std::accumulate(outcome.step_costs.begin(), outcome.step_costs.end(), 0.0),
              1e-9 * outcome.cost);
  EXPECT_TRUE(signals.is_obsolete(8));
  EXPECT_FALSE(signals.is_obsolete(7));
}

TEST_F(RolloutTest, SucceedsNoEarlierThanMinSteps) {
  aim_at_target();
  const std::uint32_t earliest = run().steps;
  batch.min_steps = static_cast<int>(earliest);  // one step later, 0-based
  const RolloutOutcome outcome = run();
  EXPECT_EQ(outcome.end, End::kSucceeded);
  EXPECT_EQ(outcome.steps, earliest + 1);
}

TEST_F(RolloutTest, DoesNotSucceedAboveTheSuccessCost) {
  aim_at_target();
  const RolloutOutcome first = run();
  batch.objective.success_cost = first.cost;
  EXPECT_EQ(run().steps, first.steps);
  batch.objective.success_cost = std::nextafter(first.cost, 0.0);
  EXPECT_GT(run().steps, first.steps);
  batch.objective.success_cost = 1e-6;
  EXPECT_EQ(run().end, End::kCompleted);
}

// What could still succeed is not stopped as lost: success beats any cost.
TEST_F(RolloutTest, SucceedsThoughTheIncumbentIsCheaper) {
  aim_at_target();
  batch.incumbent = 1e-9;
  EXPECT_EQ(run().end, End::kSucceeded);
}

TEST_F(RolloutTest, SendsTrajectoriesOnlyOfPossibleWinnersUnlessAsked) {
  batch.incumbent = 1e-6;
  batch.stop_losers = false;
  EXPECT_THAT(run().trajectory, testing::IsEmpty());
  batch.want_all_trajectories = true;
  EXPECT_EQ(run().trajectory.size(), 5u);
}

TEST_F(RolloutTest, DivergesWithAReasonInsteadOfCrashing) {
  batch.x0.v[9] = 1e12;
  const RolloutOutcome outcome = run();
  EXPECT_EQ(outcome.end, End::kDiverged);
  EXPECT_EQ(outcome.cost, kInfinity);
  EXPECT_THAT(outcome.reason, testing::Not(testing::IsEmpty()));
  EXPECT_EQ(outcome.steps, 0u);
  batch.x0.v[9] = 0;
  EXPECT_EQ(run().end, End::kCompleted);
}

TEST_F(RolloutTest, WaitsInsteadOfSimulatingWhenAskedTo) {
  batch.wait = std::chrono::nanoseconds(1);
  const RolloutOutcome outcome = run();
  EXPECT_EQ(outcome.end, End::kCompleted);
  EXPECT_EQ(outcome.engine_steps, 0u);
}

}  // namespace
}  // namespace jostle::physics_pool
