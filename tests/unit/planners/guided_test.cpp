// Guided planning in real physics, and its parts.

#include "planners/guided/guided.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <set>

#include "physics_pool/local/thread_pool.hpp"
#include "planners/control/controller.hpp"
#include "planners/guided/candidates.hpp"
#include "tests/support/pushing.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::planners {
namespace {

using ::testing::HasSubstr;

constexpr TimePoint kNever = TimePoint::max();

class GuidedTest : public testing::Test {
 protected:
  Problem problem() {
    Problem p{.world = physics_pool::scene_hash(scene),
              .x0 = initial_state(scene),
              .initial = straight_line(geometry, initial_state(scene), 4, 1.0),
              .iterations = 4,
              .seed = 3};
    p.objective["obstruction"].weight = 0.0;
    return p;
  }
  Plan planned(int pool_threads, int guidance_threads, const Problem& p) {
    physics_pool::ThreadPool pool(pool_threads);
    EXPECT_TRUE(pool.load(scene));
    auto sut_result = GuidedPlanner::make(pool, scene, {}, {.candidates = 60, .threads = guidance_threads});
    if (!sut_result) throw std::runtime_error(sut_result.error().message);
    auto plan_result = (*sut_result)->plan(p, kNever);
    if (!plan_result) throw std::runtime_error(plan_result.error().message);
    return std::move(plan_result).value();
  }

  // Another object stands between hand and target.
  static physics_pool::Scene in_the_way() {
    physics_pool::Scene scene = tests::target_only();
    scene.objects.push_back(tests::cylinder("can", -0.1, 0.01));
    return scene;
  }

  const physics_pool::Scene scene = in_the_way();
  const physics_pool::TaskGeometry geometry{scene};
  const CandidateLaw law{
      .sigma = {0.04, 0.04, 0.25, 0.004}, .limit = {0.15, 0.15, 0.8, 0.05}, .step_duration = 1.0, .seed = 1};
};

TEST_F(GuidedTest, CandidatesKeepTheLimitsAndComeFromEachFamily) {
  const State x = initial_state(scene);
  const ControlSequence line = straight_line(geometry, x, 4, 1.0);
  int back = 0, turned = 0;
  for (std::uint32_t i = 0; i < 300; ++i) {
    const ControlSequence controls = draw_candidate(geometry, law, line, {.x = &x}, {.stream = 0, .number = i});
    ASSERT_EQ(controls.steps(), 4);
    double turn = 0.0;
    for (int t = 0; t < 4; ++t) {
      for (std::size_t a = 0; a < 4; ++a) ASSERT_LE(std::abs(controls.step(t)[a]), law.limit[a]);
      turn += controls.step(t)[2];
    }
    back += controls.step(0)[0] < -0.01 ? 1 : 0;
    turned += std::abs(turn) > 0.4 ? 1 : 0;
    EXPECT_EQ(controls, draw_candidate(geometry, law, line, {.x = &x}, {.stream = 0, .number = i}));
  }
  EXPECT_GT(back, 15);
  EXPECT_GT(turned, 30);
}

TEST_F(GuidedTest, CandidateFromAKnownStateKeepsTheControlsThatLeadThere) {
  const State x = initial_state(scene);
  const ControlSequence line = straight_line(geometry, x, 4, 1.0);
  const ControlSequence controls =
      draw_candidate(geometry, law, line, {.x = &x, .so_far = &line, .steps = 2}, {.stream = 0, .number = 5});
  ASSERT_EQ(controls.steps(), 4);
  for (int t = 0; t < 2; ++t) EXPECT_TRUE(std::ranges::equal(controls.step(t), line.step(t)));
}

TEST(Forecast, RanksSuccessBeforeCostAndWhatLodgesBehindIt) {
  const Forecast clean{.cost = 500, .succeeds = true}, lodged{.cost = 50, .succeeds = true, .lodged = 1},
      cheap{.cost = 50}, trap{.cost = 40, .lodged = 1};
  EXPECT_LT(clean.rank(), lodged.rank());
  EXPECT_LT(lodged.rank(), cheap.rank());
  EXPECT_LT(cheap.rank(), trap.rank());
}

TEST_F(GuidedTest, ReachesATargetThatTheStraightLineDoesNot) {
  const Plan plan = planned(2, 2, problem());
  ASSERT_TRUE(plan.at_goal);
  EXPECT_LE(plan.cost, 1000.0);
  EXPECT_EQ(plan.states.size(), static_cast<std::size_t>(plan.controls.steps()) + 1);
  EXPECT_TRUE(in_pre_grasp_region(geometry, plan.states.back()));
}

TEST_F(GuidedTest, PlanIsTheEnginesWord) {
  const Plan plan = planned(2, 2, problem());
  physics_pool::ThreadPool pool(1);
  ASSERT_TRUE(pool.load(scene));
  physics_pool::RolloutBatch batch{.world = physics_pool::scene_hash(scene),
                                   .x0 = initial_state(scene),
                                   .nominal = plan.controls,
                                   .u_before = {0, 0, 0, 0},
                                   .law = {.sigma = {0, 0, 0, 0}, .limit = law.limit},
                                   .objective = problem().objective};
  const auto reply = pool.run(batch, kNever);
  ASSERT_TRUE(reply) << reply.error().message;
  EXPECT_EQ(reply->outcomes[0].cost, plan.cost);
  EXPECT_EQ(reply->outcomes[0].trajectory, plan.states);
}

TEST_F(GuidedTest, PlanIsNeverWorseThanWhatItBeganWith) {
  const Plan good = planned(2, 2, problem());
  Problem again = problem();
  again.initial = good.controls;
  again.objective.success_cost = 1e-3;  // nothing succeeds: no plan is taken for that alone
  again.iterations = 1;
  for (const std::uint32_t stream : {1u, 2u, 3u}) {
    again.stream = stream;
    EXPECT_LE(planned(2, 2, again).cost, good.cost) << stream;
  }
}

TEST_F(GuidedTest, WhatIsLeftOfAGoodPlanIsThePlanAndCostsOneRollout) {
  const Plan good = planned(2, 2, problem());
  ASSERT_GE(good.controls.steps(), 3);
  Problem again = problem();
  // Fewer steps than n_min: no rollout of them ends early as a success.
  again.x0 = good.states[good.states.size() - 3];
  again.initial = good.controls;
  while (again.initial.steps() > 2) again.initial.drop_first();
  const Plan plan = planned(2, 2, again);
  EXPECT_TRUE(plan.at_goal);
  EXPECT_EQ(plan.controls, again.initial);
  EXPECT_EQ(plan.rollouts, 1u);
}

TEST_F(GuidedTest, AnyNumberOfThreadsGivesTheSamePlanBitForBit) {
  Problem hard = problem();
  hard.objective.success_cost = 1e-3;  // nothing succeeds: every iteration has its part
  hard.iterations = 2;
  const Plan one = planned(1, 1, hard), many = planned(3, 4, hard);
  EXPECT_EQ(one.controls, many.controls);
  EXPECT_EQ(one.states, many.states);
  EXPECT_EQ(one.cost, many.cost);
  EXPECT_EQ(one.rollouts, many.rollouts);
  EXPECT_EQ(one.iterations, 2);
}

TEST_F(GuidedTest, AnotherSeedGivesAnotherPlan) {
  Problem other = problem();
  ++other.seed;
  EXPECT_NE(planned(2, 1, problem()).controls, planned(2, 1, other).controls);
}

TEST_F(GuidedTest, StopsWhenItIsToldTo) {
  physics_pool::ThreadPool pool(1);
  ASSERT_TRUE(pool.load(scene));
  auto sut = std::move(GuidedPlanner::make(pool, scene, {}, {.candidates = 60})).value();
  std::stop_source stop;
  stop.request_stop();
  const auto stopped = sut->plan(problem(), kNever, stop.get_token());
  ASSERT_FALSE(stopped);
  EXPECT_EQ(stopped.error().code, Code::kCancelled);
  const auto late = sut->plan(problem(), TimePoint::min());
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, Code::kDeadline);
}

TEST(Guided, RefusesARobotWithoutAHand) {
  physics_pool::ThreadPool pool(1);
  const auto result = GuidedPlanner::make(pool, tests::four_sliders(), {}, {.candidates = 60});
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr("planner.guidance"));
}

}  // namespace
}  // namespace jostle::planners
