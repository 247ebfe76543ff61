#include "planners/adaptive/adaptive.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "physics_pool/local/rollout.hpp"
#include "physics_pool/local/simulator.hpp"
#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/objective/scorer.hpp"
#include "planners/adaptive/action_sequences.hpp"
#include "tests/support/bowl_pool.hpp"
#include "tests/support/kinematic_world.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::planners {
namespace {

using namespace tests;
using namespace physics_pool;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

const TimePoint kNoDeadline = TimePoint::max();

Plan plan_of(Planner& sut, const Problem& problem) {
  auto result = sut.plan(problem, kNoDeadline);
  if (!result) {
    ADD_FAILURE() << result.error().message;
    return {};
  }
  return std::move(result).value();
}

// Line 2 of Alg. 7 by hand: ceil(19/4·k) + 1, and so on.
TEST(ActionCounts, GrowFromTheFewestToTheMost) {
  EXPECT_THAT(action_counts(1, 20, 5), ElementsAre(1, 6, 11, 16, 20));
  EXPECT_THAT(action_counts(2, 4, 2), ElementsAre(2, 4));  // Fig. 5.2
  EXPECT_THAT(action_counts(1, 10, 6), ElementsAre(1, 3, 5, 7, 9, 10));
  EXPECT_THAT(action_counts(1, 3, 5), ElementsAre(1, 2, 2, 3, 3));
  EXPECT_THAT(action_counts(7, 7, 3), ElementsAre(7, 7, 7));  // UAMPC
  EXPECT_THAT(action_counts(1, 20, 1), ElementsAre(1));       // N - 1 = 0 divides nothing
  EXPECT_THAT(action_counts(1, 20, 0), IsEmpty());
}

// The pusher's side is 1 cm behind the target, which has 0.4 m to go.
TEST(ActionSequences, GoStraightAtConstantSpeeds) {
  const Scene scene = push_ahead();
  const TaskGeometry geometry(scene);
  const State x = initial_state(scene);
  const auto sequences = action_sequences(geometry, x, 1, 4, 4, 0.5, {2.0, 2.0});
  ASSERT_EQ(sequences.size(), 4u);
  for (int n = 1; n <= 4; ++n) {
    const ControlSequence& controls = sequences[static_cast<std::size_t>(n) - 1];
    ASSERT_EQ(controls.steps(), n);
    for (int t = 0; t < n; ++t) {
      EXPECT_NEAR(controls.step(t)[kControlX], 0.41 / (n * 0.5), 1e-12);
      EXPECT_NEAR(controls.step(t)[kControlY], 0.0, 1e-12);
    }
  }
}

TEST(ActionSequences, LeadFromTheToolToTheMiddleOfTheGoal) {
  Scene scene = push_ahead();
  scene.task.goal.x = scene.robot.q[0] + 0.3;
  scene.task.goal.y = scene.robot.q[1] + 0.4;
  const StraightWay way = straight_way(TaskGeometry(scene), initial_state(scene));
  EXPECT_NEAR(way.dx, 0.6, 1e-12);
  EXPECT_NEAR(way.dy, 0.8, 1e-12);
}

TEST(ActionSequences, OfAGraspLeadToWhereTheHandHasTheTarget) {
  const Scene scene = target_only();  // 0.33 m ahead
  const StraightWay way = straight_way(TaskGeometry(scene), initial_state(scene));
  EXPECT_NEAR(way.dx, 1.0, 1e-12);
  EXPECT_NEAR(way.length, 0.33 - kHand.depth, 1e-12);
}

TEST(ActionSequences, KeepTheirDirectionAtTheLimit) {
  Scene scene = push_ahead();
  scene.task.goal.x = scene.robot.q[0] + 0.3;
  scene.task.goal.y = scene.robot.q[1] + 0.4;
  const auto sequences = action_sequences(TaskGeometry(scene), initial_state(scene), 1, 1, 1, 0.01, {1.0, 0.4});
  EXPECT_NEAR(sequences[0].step(0)[kControlX], 0.3, 1e-12);
  EXPECT_NEAR(sequences[0].step(0)[kControlY], 0.4, 1e-12);
}

// Every control step costs its squared distance from a wanted control.
class AdaptiveBowl : public testing::Test {
 protected:
  AdaptiveBowl() {
    optimizer.rollouts = 6;
    options.sequences = 1;
    options.least_actions = options.most_actions = 1;
    options.samples = 0;
    options.iterations = 1;
    problem.initial = {};
    problem.objective.success_cost = 0.0;
  }

  Plan plan() {
    AdaptivePlanner sut(pool, geometry, optimizer, options);
    return plan_of(sut, problem);
  }

  const Scene scene = target_only();
  const TaskGeometry geometry{scene};
  BowlPool pool{{0.1, 0.05, 0.0, 0.0}};
  PbstoOptions optimizer;
  AdaptiveOptions options;
  Problem problem = bowl_problem(1);
};

TEST_F(AdaptiveBowl, CostWeightedUpdateBecomesGreedyAsLambdaVanishes) {
  const Plan greedy = plan();
  optimizer.update = PbstoOptions::Update::kCostWeighted;
  optimizer.lambda = 1e9;  // the plain mean
  const Plan mean = plan();
  EXPECT_NE(mean.controls, greedy.controls);
  double before = std::numeric_limits<double>::infinity();
  for (const double lambda : {1.0, 0.1, 1e-3}) {
    optimizer.lambda = lambda;
    const double away = std::abs(plan().controls.values[0] - greedy.controls.values[0]);
    EXPECT_LE(away, before);
    before = away;
  }
  optimizer.lambda = 1e-9;
  EXPECT_EQ(plan().controls, greedy.controls);
}

// Eq. 5.8 weighs each action by its own cost: with a small lambda each is that of the sample that does it best.
TEST_F(AdaptiveBowl, CostWeightedUpdateTakesTheBestOfEveryAction) {
  options.least_actions = options.most_actions = 3;
  optimizer.update = PbstoOptions::Update::kCostWeighted;
  optimizer.lambda = 1e-9;
  const Plan got = plan();
  ASSERT_EQ(pool.batches.size(), 3u);  // the candidate, its noisy copies, their mean
  const RolloutBatch& noisy = pool.batches[1];
  ASSERT_EQ(noisy.samples, 6u);
  for (int t = 0; t < 3; ++t) {
    double least = std::numeric_limits<double>::infinity();
    std::vector<double> best;
    for (std::uint32_t k = 0; k < noisy.samples; ++k) {
      const ControlSequence sample = sample_controls(noisy.nominal, noisy.law, noisy.first_sample + k);
      const double cost = pool.step_costs(sample)[static_cast<std::size_t>(t)];
      if (cost >= least) continue;
      least = cost;
      best.assign(sample.step(t).begin(), sample.step(t).end());
    }
    const auto u = got.controls.step(t);
    EXPECT_EQ(std::vector<double>(u.begin(), u.end()), best);
  }
}

TEST_F(AdaptiveBowl, KeepsACandidateThatNoSampleBeats) {
  problem.initial = {.nu = 4, .values = {0.1, 0.05, 0.0, 0.0}};  // cannot be better
  const Plan got = plan();
  EXPECT_EQ(got.controls, problem.initial);
  EXPECT_EQ(got.cost, 0.0);
}

TEST_F(AdaptiveBowl, ImprovesNothingThatIsCheapEnoughBesideItsActions) {
  problem.objective["action"].weight = 100.0;  // the bowl's costs have nothing of it
  problem.initial = {.nu = 4, .values = {0.0, 0.05, 0.0, 0.0}};
  problem.objective.success_cost = 9.0;
  pool.extra = [](const RolloutBatch& batch) { return 100.0 * batch.nominal.steps(); };
  plan();
  EXPECT_EQ(pool.batches.size(), 2u);  // 10 of 0.1 m/s: one iteration
  pool.batches.clear();
  problem.objective.success_cost = 11.0;
  plan();
  EXPECT_EQ(pool.batches.size(), 1u);
}

TEST_F(AdaptiveBowl, GivesCandidatesThatBeginAlikeOtherNoise) {
  options.sequences = 3;
  plan();
  ASSERT_EQ(pool.batches.size(), 6u);
  EXPECT_EQ(pool.batches[3].nominal, pool.batches[4].nominal);
  const auto first = [&](const RolloutBatch& b) { return sample_controls(b.nominal, b.law, b.first_sample); };
  EXPECT_NE(first(pool.batches[3]), first(pool.batches[4]));
}

TEST_F(AdaptiveBowl, JudgesAllCandidatesWithTheSameNoiseAndTheNextDecisionWithOther) {
  options.sequences = 3;
  options.most_actions = 3;
  options.iterations = 0;
  options.samples = 4;
  options.noise = 0.2;
  plan();
  ASSERT_EQ(pool.batches.size(), 6u);
  for (std::size_t i = 3; i < 6; ++i) {
    EXPECT_EQ(pool.batches[i].nominal.steps(), 1);
    EXPECT_EQ(pool.batches[i].first_sample, pool.batches[3].first_sample);
    EXPECT_EQ(pool.batches[i].noise, (VelocityNoise{.slope = 0.2, .seed = 42}));
    EXPECT_EQ(pool.batches[i].rest, options.rest);
  }
  ++problem.stream;
  plan();
  EXPECT_GE(pool.batches.back().first_sample, pool.batches[3].first_sample + 4);
}

TEST_F(AdaptiveBowl, StopsImprovingWhenItsRolloutsAreSpent) {
  options.iterations = 50;
  problem.rollouts = 1 + 2 * 6;
  EXPECT_EQ(plan().rollouts, 13u);
}

TEST_F(AdaptiveBowl, SaysWhyThereIsNoPlan) {
  pool.diverges = [](const RolloutBatch&, std::uint32_t) { return true; };
  AdaptivePlanner sut(pool, geometry, optimizer, options);
  const auto result = sut.plan(problem, kNoDeadline);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Code::kInvalidArgument);
  EXPECT_THAT(result.error().message, HasSubstr("told to diverge"));
}

TEST_F(AdaptiveBowl, ACandidateThatNoiseBreaksIsWorthNothing) {
  options.sequences = 2;
  options.most_actions = 2;
  options.samples = 2;
  options.iterations = 0;
  pool.diverges = [](const RolloutBatch& batch, std::uint32_t) {
    return batch.noise.slope > 0 && batch.nominal.step(0)[0] > 0.147;
  };
  problem.x0.q[kJointX] = -0.33;  // 0.29 m to go, at 0.15 m/s at most
  const Plan got = plan();
  EXPECT_EQ(got.choices.at(0).value, kInfinity);
  EXPECT_EQ(got.chosen, 1);
}

// A pusher and a slider in one line, with all that noise does to them: the engine's own.
class OneDimensionalPush : public testing::Test {
 protected:
  OneDimensionalPush() {
    scene.physics.time_step = 0.002;
    world = std::move(World::compile(scene)).value();
    objective = Objective{.success_cost = 1.0};
    objective["action"].weight = 10.0;
    objective["miss"].weight = 1e4;
    optimizer.sigma = {0.02, 0.0};
    optimizer.limit = {0.6, 0.6};
    options.sequences = 4;
    options.most_actions = 4;
    options.iterations = 0;
    options.samples = 6;
    options.rest = 0.2;
  }

  Plan plan(int threads = 2) {
    ThreadPool pool(threads);
    Problem problem{.world = std::move(pool.load(scene)).value(), .x0 = initial_state(scene)};
    problem.seed = 5;
    problem.stream = 3;
    problem.objective = objective;
    problem.initial = initial;
    AdaptivePlanner sut(pool, world->geometry(), optimizer, options);
    return plan_of(sut, problem);
  }

  // f of one action and its rest; `sample`: whose noise, if any.
  State after(State x, std::span<const double> u, std::optional<std::uint32_t> sample = {}) const {
    Simulator model(world);
    const std::vector<double> none(2, 0.0);
    const VelocityNoise noise = sample ? VelocityNoise{.slope = options.noise, .seed = 5} : VelocityNoise{};
    const NoiseStream stream{.sample = sample.value_or(0)};
    (void)model.advance(x, u, 500, {}, {.noise = noise, .stream = stream});
    (void)model.advance(x, none, 100, {}, {.noise = noise, .stream = stream, .first_step = 500});
    return x;
  }

  // V of every candidate, without batches or pools.
  std::vector<double> enumerated(bool printed) const {
    const double k_act = objective.weight("action"), w_f = objective.weight("miss");
    std::vector<double> values;
    for (const ControlSequence& controls :
         action_sequences(world->geometry(), initial_state(scene), 1, 4, 4, 1.0, optimizer.limit)) {
      State x = initial_state(scene);
      for (int t = 0; t < controls.steps(); ++t) x = after(x, controls.step(t));
      const double last = w_f * miss_cost(world->geometry(), x);
      const double from_first = k_act * controls.steps() + last, from_second = from_first - k_act;
      double sum = 0.0;
      for (std::uint32_t q = 0; q < 6; ++q) {
        const State there = after(initial_state(scene), controls.step(0), 3 * 6 + q);
        if (printed) {
          sum += k_act + from_first;
        } else {
          sum += k_act + (controls.steps() > 1 ? from_second : w_f * miss_cost(world->geometry(), there));
        }
      }
      values.push_back(sum / 6);
    }
    return values;
  }

  Scene scene = push_ahead();
  WorldPtr world;
  Objective objective;
  PbstoOptions optimizer;
  AdaptiveOptions options;
  ControlSequence initial;
};

TEST_F(OneDimensionalPush, ChoosesTheSpeedThatFullEnumerationFinds) {
  std::vector<int> chosen;
  for (const double noise : {0.0, 0.02, 0.1}) {
    for (const bool printed : {false, true}) {
      options.noise = noise;
      options.value = printed ? AdaptiveOptions::Value::kPrinted : AdaptiveOptions::Value::kNext;
      const Plan got = plan();
      const std::vector<double> wanted = enumerated(printed);
      ASSERT_EQ(got.choices.size(), wanted.size());
      for (std::size_t i = 0; i < wanted.size(); ++i) EXPECT_NEAR(got.choices[i].value, wanted[i], 1e-9 * wanted[i]);
      EXPECT_EQ(got.chosen, std::ranges::min_element(wanted) - wanted.begin()) << "b " << noise;
      EXPECT_EQ(got.cost, got.choices[static_cast<std::size_t>(got.chosen)].value);
      if (!printed) chosen.push_back(got.chosen);
    }
  }
  EXPECT_EQ(chosen.front(), 0);  // the fastest, where nothing is uncertain
  EXPECT_GT(chosen.back(), 0);   // a slower one, where the fastest misses
}

TEST_F(OneDimensionalPush, MoreSpeedMeansMoreSpread) {
  options.noise = 0.1;
  objective["miss"].weight = 1.0;
  scene.task.goal.radius = 1e-3;
  options.most_actions = options.least_actions = 1;
  options.sequences = 1;
  const double fast = plan().choices[0].spread;
  optimizer.limit = {0.05, 0.05};
  EXPECT_GT(fast, 2 * plan().choices[0].spread);
}

TEST_F(OneDimensionalPush, IsBitEqualOnAnyNumberOfThreads) {
  options.iterations = 2;
  objective.success_cost = 0.0;
  const Plan one = plan(1), four = plan(4);
  EXPECT_EQ(one.controls, four.controls);
  EXPECT_EQ(one.states, four.states);
  EXPECT_EQ(one.choices, four.choices);
  EXPECT_EQ(one.rollouts, four.rollouts);
  EXPECT_EQ(one.cost, four.cost);
}

// Line 15 of Alg. 6.
TEST_F(OneDimensionalPush, WhatIsLeftIsOneOfNCandidates) {
  options.samples = 0;
  initial.nu = 2;
  for (int t = 0; t < 5; ++t) initial.append(std::vector<double>{0.05, 0.0});
  const Plan got = plan();
  std::vector<int> actions;
  for (const Choice& choice : got.choices) actions.push_back(choice.actions);
  EXPECT_THAT(actions, ElementsAre(1, 3, 4, 5));
  EXPECT_NEAR(got.choices.back().speed, 0.05, 1e-12);
}

TEST(StochasticExecution, NoiseHasTheStatedMomentsAndIsNotTheWorlds) {
  const VelocityNoise noise{.slope = 0.1, .seed = 9};
  constexpr int kDraws = 40000;
  double sum = 0.0, square = 0.0, product = 0.0;
  for (int i = 0; i < kDraws; ++i) {
    const auto draw = [&](Purpose purpose) {
      return velocity_draw(noise, {.purpose = purpose, .sample = static_cast<std::uint32_t>(i % 8)},
                           static_cast<std::uint64_t>(i / 8), i % 11);
    };
    const double z = draw(Purpose::kPredictedNoise);
    sum += z;
    square += z * z;
    product += z * draw(Purpose::kExecutedNoise);
  }
  const double error = 5 / std::sqrt(double{kDraws});  // five standard errors
  EXPECT_NEAR(sum / kDraws, 0.0, error);
  EXPECT_NEAR(square / kDraws, 1.0, error * std::sqrt(2.0));
  EXPECT_NEAR(product / kDraws, 0.0, error);
}

class AdaptiveRun : public testing::Test {
 protected:
  AdaptiveRun() {
    planner.change = [this](Plan& plan, int plans) {
      if (plan.controls.steps() > 0) return;
      plan.controls = {.nu = 2};
      for (int t = 0; t < length; ++t) plan.controls.append(std::vector<double>{0.01 * plans, 0.0});
      for (int t = 0; t < length; ++t) plan.states.push_back(plan.states.back());
    };
    options.rest = 0.25;
    options.max_actions = 4;
    options.iterations = 3;
  }

  Outcome outcome() {
    auto result = run_adaptive(setup, options);
    if (!result) {
      ADD_FAILURE() << result.error().message;
      return {};
    }
    return std::move(result).value();
  }

  double* target() { return &x.q[static_cast<std::size_t>(geometry.layout.objects[0].q)]; }

  const Scene scene = push_ahead();
  const TaskGeometry geometry{scene};
  State x = initial_state(scene);
  KinematicRobot robot{x, 2, kPusherControls};
  KinematicObjects objects{geometry.layout, x};
  KinematicPlanner planner;
  ControlSetup setup{.planner = planner,
                     .robot = robot,
                     .objects = objects,
                     .geometry = geometry,
                     .objective = Objective::standard(),
                     .world = hash_of("world"),
                     .seed = 11,
                     .make_feasible = {}};
  AdaptiveOptions options;
  int length = 3;  // of fresh plans
};

TEST_F(AdaptiveRun, RestsAfterEveryAction) {
  EXPECT_EQ(outcome().ending, Ending::kFailed);
  ASSERT_EQ(robot.executed.size(), 8u);
  for (std::size_t i = 0; i < 8; ++i) {
    EXPECT_EQ(robot.durations[i], i % 2 == 0 ? 1.0 : 0.25);
    if (i % 2 == 1) EXPECT_THAT(robot.executed[i], Each(0.0));
  }
}

TEST_F(AdaptiveRun, GoesOnWithWhatIsLeftUntilNothingIs) {
  outcome();
  std::vector<int> left;
  for (const Problem& problem : planner.problems) left.push_back(problem.initial.steps());
  EXPECT_THAT(left, ElementsAre(0, 2, 1, 0));
  EXPECT_EQ(planner.problems[1].stream, planner.problems[0].stream + 3);
}

TEST_F(AdaptiveRun, SucceedsByWhatIsSeenAfterTheRest) {
  robot.after_execute = [this](State&, int executed) {
    if (executed == 3) target()[0] = 0.2;  // in mid-action
    if (executed == 4) target()[0] = 0.1;  // it slides on, out of the region again
    if (executed == 6) target()[0] = 0.2;
  };
  const Outcome got = outcome();
  EXPECT_TRUE(got.success) << got.reason;
  EXPECT_EQ(got.actions, 3);
}

TEST_F(AdaptiveRun, FailsWhenTheTargetFalls) {
  robot.after_execute = [this](State&, int) { target()[2] -= 0.5; };
  const Outcome got = outcome();
  EXPECT_EQ(got.ending, Ending::kFailed);
  EXPECT_THAT(got.reason, HasSubstr("dropped target"));
  EXPECT_EQ(got.actions, 1);
}

TEST(Baselines, AreTheSolverWithSlowCandidatesAndOneWithoutNoise) {
  const AdaptiveOptions options{.sequences = 5, .least_actions = 1, .most_actions = 12, .samples = 8};
  const AdaptiveOptions slow = slow_only(options), mpc = standard_mpc(options);
  EXPECT_EQ(slow.least_actions, 12);
  EXPECT_EQ(slow.sequences, 5);
  EXPECT_EQ(slow.samples, 8);
  EXPECT_EQ(mpc.least_actions, 12);
  EXPECT_EQ(mpc.sequences, 1);
  EXPECT_EQ(mpc.samples, 0);
}

}  // namespace
}  // namespace jostle::planners
