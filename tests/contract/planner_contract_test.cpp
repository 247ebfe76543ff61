// What every Planner promises, asked of every implementation.

#include <gmock/gmock.h>

#include <chrono>
#include <cmath>

#include "physics_pool/local/thread_pool.hpp"
#include "planners/guided/guided_start.hpp"
#include "planners/pbsto/pbsto.hpp"
#include "planners/robustness/robust_sto.hpp"
#include "planners/sampling/sampling.hpp"
#include "tests/support/batches.hpp"
#include "tests/support/bowl_pool.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using physics_pool::Pool;
using planners::OnProgress;
using planners::Pbsto;
using planners::PbstoOptions;
using planners::Plan;
using planners::Planner;
using planners::Problem;
using planners::Progress;
using planners::SamplingOptions;
using planners::SamplingPlanner;
using planners::TimePoint;

constexpr TimePoint kNever = TimePoint::max();
const std::vector<double> kWanted{0.08, -0.05, 0.2, 0.01};

// What the suite sets of any planner's options.
struct Settings {
  int rollouts = 12;
  std::vector<double> sigma{0.03, 0.03, 0.05, 0.01};
  std::vector<double> limit{0.15, 0.15, 0.8, 0.05};
  double lambda = 1.0;
  double step_duration = 0.2;
};

struct Implementation {
  const char* name;
  std::unique_ptr<Planner> (*make)(Pool& pool, const Settings& settings, OnProgress on_progress);
};

template <PbstoOptions::Update update>
std::unique_ptr<Planner> pbsto(Pool& pool, const Settings& settings, OnProgress on_progress) {
  const PbstoOptions options{.rollouts = settings.rollouts,
                             .sigma = settings.sigma,
                             .limit = settings.limit,
                             .update = update,
                             .lambda = settings.lambda,
                             .step_duration = settings.step_duration};
  return std::make_unique<Pbsto>(pool, options, std::move(on_progress));
}

template <SamplingOptions::Method method>
std::unique_ptr<Planner> sampling(Pool& pool, const Settings& settings, OnProgress on_progress) {
  const SamplingOptions options{.method = method,
                                .rollouts = settings.rollouts,
                                .sigma = settings.sigma,
                                .limit = settings.limit,
                                .lambda = settings.lambda,
                                .step_duration = settings.step_duration};
  return std::make_unique<SamplingPlanner>(pool, options, std::move(on_progress));
}

// Its worlds and starts have tests of their own (robust_sto_test.cpp): a bowl is the same in every world.
template <int starts>
std::unique_ptr<Planner> robust_sto(Pool& pool, const Settings& settings, OnProgress on_progress) {
  static const physics_pool::Scene scene = starts > 0 ? small_scene() : target_only();
  static const physics_pool::TaskGeometry geometry(scene);
  const PbstoOptions optimizer{.rollouts = settings.rollouts,
                               .sigma = settings.sigma,
                               .limit = settings.limit,
                               .step_duration = settings.step_duration};
  // No final cost is so low: a plan that satisfies it would be done before the suite has seen anything.
  const planners::RobustStoOptions options{.starts = starts, .worlds = 1, .terminal_cost = -1.0};
  return std::make_unique<planners::RobustSto>(pool, scene, geometry, optimizer, options, std::move(on_progress));
}

// In small_scene(): it has a model of its own, for which a bowl would be no physics.
std::unique_ptr<planners::GuidedPlanner> guide(Pool& pool, const Settings& settings, OnProgress on_progress) {
  const PbstoOptions options{.sigma = settings.sigma, .limit = settings.limit, .step_duration = settings.step_duration};
  return planners::GuidedPlanner::make(pool, small_scene(), options, {.candidates = 30}, std::move(on_progress))
      .value();
}

std::unique_ptr<Planner> guided(Pool& pool, const Settings& settings, OnProgress on_progress) {
  return guide(pool, settings, std::move(on_progress));
}

std::unique_ptr<Planner> guided_start(Pool& pool, const Settings& settings, OnProgress on_progress) {
  return std::make_unique<planners::GuidedStart>(guide(pool, settings, {}),
                                                 robust_sto<0>(pool, settings, std::move(on_progress)));
}

class PlannerContract : public ::testing::TestWithParam<Implementation> {
 protected:
  std::unique_ptr<Planner> planner(Pool& pool) {
    return GetParam().make(pool, settings, [this](const Progress& progress) { news.push_back(progress); });
  }

  static Plan planned(Planner& sut, const Problem& problem) {
    auto plan_result = sut.plan(problem, kNever);
    if (!plan_result) throw std::runtime_error(plan_result.error().message);
    return std::move(plan_result).value();
  }

  // With a planner of its own.
  Plan planned(const Problem& problem) { return planned(*planner(bowl), problem); }

  std::uint64_t samples_asked() const {
    std::uint64_t sum = 0;
    for (const auto& batch : bowl.batches) sum += batch.samples;
    return sum;
  }

  double initial_cost() const { return bowl.cost(bowl_problem(1).initial); }

  Settings settings;
  BowlPool bowl{kWanted};
  std::vector<Progress> news;
};

void expect_equal(const Plan& a, const Plan& b) {
  EXPECT_EQ(a.controls, b.controls);
  EXPECT_EQ(a.states, b.states);
  EXPECT_EQ(a.cost, b.cost);
  EXPECT_EQ(a.at_goal, b.at_goal);
  EXPECT_EQ(a.iterations, b.iterations);
  EXPECT_EQ(a.rollouts, b.rollouts);
  EXPECT_EQ(a.denials, b.denials);
  EXPECT_EQ(a.robustness, b.robustness);
}

TEST_P(PlannerContract, EqualProblemsGiveBitEqualPlans) {
  const auto sut = planner(bowl);
  const Plan first = planned(*sut, bowl_problem(8));

  expect_equal(planned(*sut, bowl_problem(8)), first);
  expect_equal(planned(bowl_problem(8)), first);  // nothing stays from plan to plan, or planner to planner
}

TEST_P(PlannerContract, AnotherSeedOrStreamGivesAnotherPlan) {
  const Plan plan = planned(bowl_problem(8));
  Problem other_seed = bowl_problem(8), other_stream = bowl_problem(8);
  ++other_seed.seed;
  other_stream.stream += 100;

  EXPECT_NE(planned(other_seed).controls, plan.controls);
  EXPECT_NE(planned(other_stream).controls, plan.controls);
}

TEST_P(PlannerContract, StatesBeginAtTheStartAndFollowTheControls) {
  Problem problem = bowl_problem(8);
  problem.x0.q[0] = 0.3;

  const Plan plan = planned(problem);

  ASSERT_EQ(plan.states.size(), static_cast<std::size_t>(plan.controls.steps()) + 1);
  State x = problem.x0;
  EXPECT_EQ(plan.states.front(), x);
  for (int t = 0; t < plan.controls.steps(); ++t) {
    for (std::size_t i = 0; i < kWanted.size(); ++i) x.q[i] += plan.controls.step(t)[i];
    EXPECT_EQ(plan.states[static_cast<std::size_t>(t) + 1], x) << "after step " << t;
  }
}

TEST_P(PlannerContract, CostIsThatOfTheControls) {
  const Plan plan = planned(bowl_problem(8));
  EXPECT_NEAR(plan.cost, bowl.cost(plan.controls), 1e-9);
}

TEST_P(PlannerContract, CostIsNeverWorseThanTheInitialControls) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    Problem problem = bowl_problem(3);
    problem.seed = seed;
    // At the optimum nothing can be gained, nearby little.
    const double distance = 0.001 * static_cast<double>(seed);
    for (int t = 0; t < problem.initial.steps(); ++t) {
      for (std::size_t i = 0; i < kWanted.size(); ++i) problem.initial.step(t)[i] = kWanted[i] + distance;
    }

    const Plan plan = planned(problem);

    EXPECT_LE(plan.cost, bowl.cost(problem.initial)) << "seed " << seed;
    if (seed == 0) {
      EXPECT_EQ(plan.controls, problem.initial);
    }
  }
}

TEST_P(PlannerContract, ControlsKeepTheirLimits) {
  settings.limit = {0.05, 0.03, 0.1, 0.005};  // the optimum lies outside
  settings.sigma = {0.5, 0.5, 0.5, 0.5};
  const Plan plan = planned(bowl_problem(8));
  for (int t = 0; t < plan.controls.steps(); ++t) {
    for (std::size_t i = 0; i < kWanted.size(); ++i) EXPECT_LE(std::abs(plan.controls.step(t)[i]), settings.limit[i]);
  }
}

TEST_P(PlannerContract, CountsIterationsAndRollouts) {
  const Plan plan = planned(bowl_problem(5));
  EXPECT_EQ(plan.iterations, 5);
  EXPECT_EQ(plan.rollouts, samples_asked());
  EXPECT_GT(plan.rollouts, 5u);
  EXPECT_FALSE(plan.at_goal);
  EXPECT_EQ(plan.denials, 0);
}

TEST_P(PlannerContract, TellsProgressOncePerIteration) {
  const Plan plan = planned(bowl_problem(5));
  ASSERT_EQ(news.size(), 6u);
  EXPECT_EQ(news.front().cost, initial_cost());
  for (std::size_t i = 0; i < news.size(); ++i) {
    EXPECT_EQ(news[i].iteration, static_cast<int>(i));
    EXPECT_FALSE(news[i].at_goal);
    if (i == 0) continue;
    EXPECT_LE(news[i].cost, news[i - 1].cost);
    EXPECT_GT(news[i].rollouts, news[i - 1].rollouts);
  }
  EXPECT_EQ(news.back().cost, plan.cost);
  EXPECT_EQ(news.back().rollouts, plan.rollouts);
}

TEST_P(PlannerContract, NoIterationsGiveTheInitialControlsAndTheirCost) {
  const Plan plan = planned(bowl_problem(0));
  EXPECT_EQ(plan.controls, bowl_problem(0).initial);
  EXPECT_EQ(plan.cost, initial_cost());
  EXPECT_EQ(plan.iterations, 0);
  EXPECT_EQ(plan.rollouts, 1u);
  EXPECT_EQ(plan.states.size(), 4u);
}

// Of planners that end a rollout at its first success; others roll every trajectory out to its end.
class EarlyEndContract : public PlannerContract {};

TEST_P(EarlyEndContract, EndsAtTheFirstSuccess) {
  bowl.can_succeed = true;
  Problem problem = bowl_problem(1000);
  problem.objective.success_cost = 0.5 * initial_cost();

  const Plan plan = planned(problem);

  EXPECT_TRUE(plan.at_goal);
  EXPECT_LE(plan.cost, problem.objective.success_cost);
  EXPECT_LT(plan.iterations, 1000);
  for (std::size_t i = 0; i + 1 < news.size(); ++i) EXPECT_FALSE(news[i].at_goal);
  EXPECT_TRUE(news.back().at_goal);
}

TEST_P(PlannerContract, ApproachesTheOptimum) {
  settings.rollouts = 40;
  for (const std::uint64_t seed : {1u, 2u, 3u}) {
    Problem problem = bowl_problem(100);
    problem.seed = seed;

    const Plan plan = planned(problem);

    EXPECT_LT(plan.cost, 0.05 * initial_cost()) << "seed " << seed;  // the optimum costs nothing
  }
}

TEST_P(PlannerContract, SurvivesSamplesThatDiverge) {
  bowl.diverges = [](const auto& batch, std::uint32_t sample) { return batch.samples > 1 && sample % 2 == 0; };
  const Plan plan = planned(bowl_problem(20));
  EXPECT_LT(plan.cost, initial_cost());
  for (const double u : plan.controls.values) EXPECT_TRUE(std::isfinite(u));
}

TEST_P(PlannerContract, OnlyDivergenceIsAnErrorThatSaysWhy) {
  bowl.diverges = [](const auto&, std::uint32_t) { return true; };
  const auto plan_result = planner(bowl)->plan(bowl_problem(3), kNever);
  ASSERT_FALSE(plan_result);
  EXPECT_EQ(plan_result.error().code, Code::kInvalidArgument);
  EXPECT_THAT(plan_result.error().message, ::testing::HasSubstr("told to diverge"));
}

TEST_P(PlannerContract, ErrorOfThePoolIsPassedOnAtOnce) {
  for (const Code code : {Code::kDeadline, Code::kUnavailable, Code::kCancelled, Code::kUnknownWorld}) {
    for (const std::size_t well : {0u, 1u, 2u, 5u}) {
      BowlPool failing{kWanted};
      failing.fail_at = well;
      failing.fail_code = code;

      const auto plan_result = planner(failing)->plan(bowl_problem(10), kNever);

      ASSERT_FALSE(plan_result) << "after " << well << " batches";
      EXPECT_EQ(plan_result.error().code, code);
      EXPECT_EQ(plan_result.error().message, "bowl: told to fail");
      EXPECT_EQ(failing.batches.size(), well + 1);
    }
  }
}

TEST_P(PlannerContract, StopRequestEndsThePlanWithCancelled) {
  std::stop_source stop;
  bowl.extra = [&](const auto& batch) {
    if (batch.samples > 1 && news.size() == 3) stop.request_stop();  // in the third iteration
    return 0.0;
  };

  const auto plan_result = planner(bowl)->plan(bowl_problem(1000), kNever, stop.get_token());

  ASSERT_FALSE(plan_result);
  EXPECT_EQ(plan_result.error().code, Code::kCancelled);
  EXPECT_LE(news.size(), 4u);
}

TEST_P(PlannerContract, EveryBatchGetsDeadlineStopAndPriority) {
  const TimePoint deadline = std::chrono::steady_clock::now() + 1h;
  Problem problem = bowl_problem(3);
  problem.priority = physics_pool::Priority::kUrgent;

  ASSERT_TRUE(planner(bowl)->plan(problem, deadline));

  EXPECT_THAT(bowl.deadlines, ::testing::Each(deadline));
  for (const auto& batch : bowl.batches) {
    EXPECT_EQ(batch.priority, problem.priority);
    EXPECT_EQ(batch.world, problem.world);
    EXPECT_EQ(batch.x0, problem.x0);
    EXPECT_EQ(batch.law.seed, problem.seed);
  }
}

// On physics: a scene of three objects, threads in this process.
class PlannerOnPhysicsContract : public PlannerContract {
 protected:
  PlannerOnPhysicsContract() {
    settings.rollouts = 6;
    settings.sigma = {0.04, 0.04, 0.25, 0.004};
    settings.lambda = 100.0;
  }

  Problem problem(Pool& pool, int iterations) const {
    Problem problem;
    problem.world = pool.load(scene).value();
    problem.x0 = physics_pool::initial_state(scene);
    for (int t = 0; t < 3; ++t) problem.initial.append(std::vector{0.1, 0.0, 0.0, 0.0});
    problem.iterations = iterations;
    problem.seed = 42;
    return problem;
  }

  const physics_pool::Scene scene = small_scene();
};

TEST_P(PlannerOnPhysicsContract, PlansAreBitEqualOnAnyPool) {
  physics_pool::ThreadPool one(1), two(2);
  const Plan on_one = planned(*planner(one), problem(one, 3)), on_two = planned(*planner(two), problem(two, 3));

  expect_equal(on_two, on_one);
  EXPECT_EQ(on_one.states.size(), static_cast<std::size_t>(on_one.controls.steps()) + 1);
  EXPECT_EQ(on_one.states.front(), problem(one, 3).x0);
  EXPECT_LE(on_one.cost, news.front().cost);
}

TEST_P(PlannerOnPhysicsContract, DeadlineInThePastIsAnErrorAtOnce) {
  physics_pool::ThreadPool pool(2);
  const auto before = std::chrono::steady_clock::now();

  const auto plan_result = planner(pool)->plan(problem(pool, 100'000), before - 1s);

  ASSERT_FALSE(plan_result);
  EXPECT_EQ(plan_result.error().code, Code::kDeadline);
  EXPECT_THAT(news, ::testing::IsEmpty());
}

TEST_P(PlannerOnPhysicsContract, DeadlineEndsAPlanUnderWay) {
  physics_pool::ThreadPool pool(2);
  const auto deadline = std::chrono::steady_clock::now() + 100ms;

  const auto plan_result = planner(pool)->plan(problem(pool, 1'000'000), deadline);

  ASSERT_FALSE(plan_result);
  EXPECT_EQ(plan_result.error().code, Code::kDeadline);
  EXPECT_LT(std::chrono::steady_clock::now() - deadline, 2s);
}

TEST_P(PlannerOnPhysicsContract, StopRequestedBeforehandIsHonoured) {
  physics_pool::ThreadPool pool(2);
  std::stop_source stop;
  stop.request_stop();

  const auto plan_result = planner(pool)->plan(problem(pool, 100'000), kNever, stop.get_token());

  ASSERT_FALSE(plan_result);
  EXPECT_EQ(plan_result.error().code, Code::kCancelled);
  EXPECT_THAT(news, ::testing::IsEmpty());
}

const auto kName = [](const auto& test) { return std::string(test.param.name); };
const auto kPbsto = ::testing::Values(Implementation{"greedy", &pbsto<PbstoOptions::Update::kGreedy>},
                                      Implementation{"cost_weighted", &pbsto<PbstoOptions::Update::kCostWeighted>});
const auto kPredictive =
    ::testing::Values(Implementation{"predictive", &sampling<SamplingOptions::Method::kPredictive>});
const auto kMppi = ::testing::Values(Implementation{"mppi", &sampling<SamplingOptions::Method::kMppi>});
const auto kCem = ::testing::Values(Implementation{"cem", &sampling<SamplingOptions::Method::kCem>});
const auto kIcem = ::testing::Values(Implementation{"icem", &sampling<SamplingOptions::Method::kIcem>});

const auto kByCost = ::testing::Values(Implementation{"by_cost", &robust_sto<0>});
const auto kRobust =
    ::testing::Values(Implementation{"by_cost", &robust_sto<0>}, Implementation{"robust", &robust_sto<2>});
const auto kGuided =
    ::testing::Values(Implementation{"alone", &guided}, Implementation{"before_another", &guided_start});

INSTANTIATE_TEST_SUITE_P(Pbsto, PlannerContract, kPbsto, kName);
INSTANTIATE_TEST_SUITE_P(Pbsto, EarlyEndContract, kPbsto, kName);
INSTANTIATE_TEST_SUITE_P(Pbsto, PlannerOnPhysicsContract, kPbsto, kName);
INSTANTIATE_TEST_SUITE_P(Predictive, PlannerContract, kPredictive, kName);
INSTANTIATE_TEST_SUITE_P(Predictive, EarlyEndContract, kPredictive, kName);
INSTANTIATE_TEST_SUITE_P(Predictive, PlannerOnPhysicsContract, kPredictive, kName);
INSTANTIATE_TEST_SUITE_P(Mppi, PlannerContract, kMppi, kName);
INSTANTIATE_TEST_SUITE_P(Mppi, EarlyEndContract, kMppi, kName);
INSTANTIATE_TEST_SUITE_P(Mppi, PlannerOnPhysicsContract, kMppi, kName);
INSTANTIATE_TEST_SUITE_P(Cem, PlannerContract, kCem, kName);
INSTANTIATE_TEST_SUITE_P(Cem, EarlyEndContract, kCem, kName);
INSTANTIATE_TEST_SUITE_P(Cem, PlannerOnPhysicsContract, kCem, kName);
INSTANTIATE_TEST_SUITE_P(Icem, PlannerContract, kIcem, kName);
INSTANTIATE_TEST_SUITE_P(Icem, EarlyEndContract, kIcem, kName);
INSTANTIATE_TEST_SUITE_P(Icem, PlannerOnPhysicsContract, kIcem, kName);
INSTANTIATE_TEST_SUITE_P(RobustSto, PlannerContract, kByCost, kName);
INSTANTIATE_TEST_SUITE_P(RobustSto, PlannerOnPhysicsContract, kRobust, kName);
INSTANTIATE_TEST_SUITE_P(Guided, PlannerOnPhysicsContract, kGuided, kName);

}  // namespace
}  // namespace jostle::tests
