#include "planners/pbsto/pbsto.hpp"

#include <gmock/gmock.h>

#include <cmath>

#include "tests/support/bowl_pool.hpp"

namespace jostle::planners {
namespace {

using physics_pool::kInfinity;
using physics_pool::sample_controls;
using tests::BowlPool;

const std::vector<double> kWanted{0.08, -0.05, 0.2, 0.01};
constexpr TimePoint kNever = TimePoint::max();

class PbstoTest : public testing::Test {
 protected:
  static Problem problem(int iterations) { return tests::bowl_problem(iterations); }

  Plan planned(const Problem& p) {
    Pbsto sut(pool, options, [this](const Progress& progress) {
      news.push_back(progress);
      final_x.push_back(progress.final_state ? progress.final_state->q[0] : std::nan(""));
    });
    Problem asked = p;
    asked.objective = objective;
    auto plan = sut.plan(asked, kNever);
    if (!plan) {
      ADD_FAILURE() << plan.error().message;
      return {};
    }
    return std::move(plan).value();
  }

  // The law of iteration i, by the definition in the headers.
  physics_pool::SamplingLaw law(const Problem& p, std::uint32_t i) const {
    return {.sigma = options.sigma,
            .limit = options.limit,
            .scales = options.scales,
            .seed = p.seed,
            .stream = p.stream + i};
  }

  BowlPool pool{kWanted};
  PbstoOptions options;
  physics_pool::Objective objective = physics_pool::Objective::standard();
  std::vector<Progress> news;
  std::vector<double> final_x;
};

class PbstoUpdate : public PbstoTest, public testing::WithParamInterface<PbstoOptions::Update> {
 protected:
  PbstoUpdate() { options.update = GetParam(); }
};

TEST_P(PbstoUpdate, NeverRaisesTheCost) {
  options.lambda = 0.5;
  const Plan plan = planned(problem(40));
  ASSERT_EQ(news.size(), 41u);
  for (std::size_t i = 1; i < news.size(); ++i) EXPECT_LE(news[i].cost, news[i - 1].cost);
  EXPECT_LT(plan.cost, 0.2 * pool.cost(problem(1).initial));
  EXPECT_NEAR(plan.cost, pool.cost(plan.controls), 1e-9);
}

TEST_P(PbstoUpdate, RespectsTheIterationLimit) {
  EXPECT_EQ(planned(problem(5)).iterations, 5);
  std::size_t noisy = 0;
  for (const auto& batch : pool.batches) noisy += batch.samples > 1 ? 1 : 0;
  EXPECT_EQ(noisy, 5u);
}

TEST_P(PbstoUpdate, PredictsTheStatesOfItsControls) {
  const Plan plan = planned(problem(6));
  ASSERT_EQ(plan.states.size(), static_cast<std::size_t>(plan.controls.steps()) + 1);
  State x = problem(6).x0;
  EXPECT_EQ(plan.states[0], x);
  for (int t = 0; t < plan.controls.steps(); ++t) {
    for (std::size_t i = 0; i < 4; ++i) x.q[i] += plan.controls.step(t)[i];
    EXPECT_EQ(plan.states[static_cast<std::size_t>(t) + 1], x);
  }
}

TEST_P(PbstoUpdate, RepeatsBitForBitAndDiffersForOtherSeeds) {
  const Plan a = planned(problem(6)), b = planned(problem(6));
  EXPECT_EQ(a.controls, b.controls);
  EXPECT_EQ(a.cost, b.cost);
  Problem other = problem(6);
  other.seed = 43;
  EXPECT_NE(planned(other).controls, a.controls);
}

TEST_P(PbstoUpdate, UsesOneStreamPerIteration) {
  (void)planned(problem(4));
  std::vector<std::uint32_t> streams;
  for (const auto& batch : pool.batches) {
    EXPECT_EQ(batch.law.seed, 42u);
    EXPECT_EQ(batch.world, hash_of("bowl"));
    if (batch.samples > 1) streams.push_back(batch.law.stream);
  }
  EXPECT_THAT(streams, testing::ElementsAre(7, 8, 9, 10));
}

TEST_P(PbstoUpdate, StopsAtSuccess) {
  pool.can_succeed = true;
  objective.success_cost = 0.5 * pool.cost(problem(1).initial);
  const Plan plan = planned(problem(1000));
  EXPECT_TRUE(plan.at_goal);
  EXPECT_LE(plan.cost, objective.success_cost);
  EXPECT_LT(plan.iterations, 1000);
  // Every batch but the last was no success.
  for (std::size_t i = 0; i + 1 < news.size(); ++i) EXPECT_FALSE(news[i].at_goal);
}

TEST_P(PbstoUpdate, PlansNothingMoreWhenTheInitialControlsSucceed) {
  pool.can_succeed = true;
  objective.success_cost = 1e9;
  const Plan plan = planned(problem(50));
  EXPECT_TRUE(plan.at_goal);
  EXPECT_EQ(plan.iterations, 0);
  EXPECT_EQ(plan.controls, problem(50).initial);
  EXPECT_EQ(pool.batches.size(), 1u);
}

TEST_P(PbstoUpdate, PassesErrorsOfThePoolOn) {
  for (const Code code : {Code::kDeadline, Code::kUnavailable, Code::kCancelled}) {
    for (const std::size_t well : {0u, 1u, 3u}) {
      BowlPool failing{kWanted};
      failing.fail_at = well;
      failing.fail_code = code;
      Pbsto sut(failing, options);
      const auto plan = sut.plan(problem(10), kNever);
      ASSERT_FALSE(plan);
      EXPECT_EQ(plan.error().code, code);
      EXPECT_EQ(plan.error().message, "bowl: told to fail");
      EXPECT_EQ(failing.batches.size(), well + 1);
    }
  }
}

TEST_P(PbstoUpdate, HandsDeadlineAndStopRequestOn) {
  const TimePoint deadline = std::chrono::steady_clock::now() + std::chrono::hours(5);
  Pbsto sut(pool, options);
  ASSERT_TRUE(sut.plan(problem(2), deadline));
  EXPECT_THAT(pool.deadlines, testing::Each(deadline));
  std::stop_source stop;
  stop.request_stop();
  const auto plan = sut.plan(problem(2), deadline, stop.get_token());
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().code, Code::kCancelled);
}

TEST_P(PbstoUpdate, SurvivesSamplesThatDiverge) {
  pool.diverges = [](const auto& batch, std::uint32_t sample) { return batch.samples > 1 && sample % 2 == 0; };
  const Plan plan = planned(problem(20));
  EXPECT_LT(plan.cost, pool.cost(problem(1).initial));
  EXPECT_NEAR(plan.cost, pool.cost(plan.controls), 1e-9);
}

TEST_P(PbstoUpdate, SurvivesAnInitialCandidateThatDiverges) {
  pool.diverges = [](const auto& batch, std::uint32_t) {
    return batch.samples == 1 && batch.incumbent == kInfinity && batch.nominal.values[0] == 0;
  };
  const Plan plan = planned(problem(20));
  EXPECT_LT(plan.cost, kInfinity);
  EXPECT_EQ(plan.states.size(), static_cast<std::size_t>(plan.controls.steps()) + 1);
}

// There is no plan whose states could be promised.
TEST_P(PbstoUpdate, ReportsAnErrorWhenEverythingDiverges) {
  pool.diverges = [](const auto&, std::uint32_t) { return true; };
  Pbsto sut(pool, options);
  const auto plan = sut.plan(problem(3), kNever);
  ASSERT_FALSE(plan);
  EXPECT_THAT(plan.error().message, testing::HasSubstr("diverged"));
  EXPECT_THAT(plan.error().message, testing::HasSubstr("told to diverge"));
}

INSTANTIATE_TEST_SUITE_P(Rules, PbstoUpdate,
                         testing::Values(PbstoOptions::Update::kGreedy, PbstoOptions::Update::kCostWeighted),
                         [](const auto& rule) {
                           return rule.param == PbstoOptions::Update::kGreedy ? "Greedy" : "CostWeighted";
                         });

TEST_F(PbstoTest, ScoresTheInitialControlsFirstWithoutNoise) {
  (void)planned(problem(1));
  ASSERT_EQ(pool.batches.size(), 2u);
  const auto& first = pool.batches[0];
  EXPECT_EQ(first.samples, 1u);
  EXPECT_THAT(first.law.sigma, testing::Each(0.0));
  EXPECT_EQ(first.nominal, problem(1).initial);
  EXPECT_EQ(first.x0, problem(1).x0);
  EXPECT_THAT(first.u_before, testing::Each(0.0));  // u_t = 0 for t < 0, Eq. 3.2
  EXPECT_EQ(news[0].iteration, 0);
  EXPECT_NEAR(news[0].cost, pool.cost(problem(1).initial), 1e-9);
}

TEST_F(PbstoTest, AsksForWhatItsOptionsSay) {
  options.rollouts = 13;
  options.step_duration = 0.7;
  options.min_steps = 3;
  options.sigma = {0.01, 0.02, 0.03, 0.04};
  options.limit = {1, 2, 3, 4};
  objective["goal"].weight = 77;
  (void)planned(problem(1));
  const auto& batch = pool.batches.back();
  EXPECT_EQ(batch.samples, 13u);
  EXPECT_EQ(batch.step_duration, 0.7);
  EXPECT_EQ(batch.min_steps, 3);
  EXPECT_EQ(batch.law.sigma, options.sigma);
  EXPECT_EQ(batch.law.limit, options.limit);
  EXPECT_EQ(batch.objective.weight("goal"), 77);
  EXPECT_TRUE(batch.stop_on_success);
}

// No iteration begins once they are spent: 1 + 8 + 8 are not yet 18.
TEST_F(PbstoTest, BeginsNoIterationOnceItsRolloutsAreSpent) {
  options.rollouts = 8;
  Problem p = problem(100);
  p.rollouts = 18;
  const Plan plan = planned(p);
  EXPECT_EQ(plan.iterations, 3);
  EXPECT_EQ(plan.rollouts, 25u);
}

TEST_F(PbstoTest, CountsTheRolloutsThatItAskedForAlsoIfItFails) {
  options.rollouts = 8;
  pool.fail_at = 2;  // the third batch, which is the second noisy one
  std::uint64_t asked_for = 0;
  Problem p = problem(50);
  p.rollouts_asked_for = &asked_for;
  Pbsto sut(pool, options);
  EXPECT_FALSE(sut.plan(p, kNever));
  EXPECT_EQ(asked_for, 1u + 8 + 8);
}

TEST_F(PbstoTest, GreedyPicksTheCheapestSample) {
  const Problem p = problem(1);
  const Plan plan = planned(p);
  ControlSequence best = p.initial;
  for (std::uint32_t k = 0; k < static_cast<std::uint32_t>(options.rollouts); ++k) {
    const ControlSequence sample = sample_controls(p.initial, law(p, 0), k);
    if (pool.cost(sample) < pool.cost(best)) best = sample;
  }
  ASSERT_NE(best, p.initial);
  EXPECT_EQ(plan.controls, best);
}

TEST_F(PbstoTest, GreedyKeepsTheCandidateWhenEverySampleIsWorse) {
  Problem p = problem(5);
  p.initial.values.clear();
  for (int t = 0; t < 3; ++t) p.initial.append(kWanted);
  const Plan plan = planned(p);
  EXPECT_EQ(plan.controls, p.initial);
  EXPECT_EQ(plan.cost, 0.0);
  EXPECT_EQ(plan.iterations, 5);
}

TEST_F(PbstoTest, GreedySearchesAroundTheNewCandidate) {
  (void)planned(problem(3));
  for (std::size_t i = 2; i < pool.batches.size(); ++i) {
    EXPECT_LE(pool.cost(pool.batches[i].nominal), pool.cost(pool.batches[i - 1].nominal));
    EXPECT_NEAR(pool.batches[i].incumbent, pool.cost(pool.batches[i].nominal), 1e-9);
  }
}

// Eq. 5.8 by hand: U*[t] = U[t] + sum_k exp(-C_k[t]/lambda)·dU_k[t] / sum_k exp(-C_k[t]/lambda).
ControlSequence eq_5_8(const BowlPool& pool, const Problem& p, const physics_pool::SamplingLaw& law, int rollouts,
                       double lambda) {
  ControlSequence mean = p.initial;
  for (int t = 0; t < p.initial.steps(); ++t) {
    for (int i = 0; i < p.initial.nu; ++i) {
      double top = 0, bottom = 0;
      for (int k = 0; k < rollouts; ++k) {
        const ControlSequence u = sample_controls(p.initial, law, static_cast<std::uint32_t>(k));
        const double weight = std::exp(-pool.step_costs(u)[std::size_t(t)] / lambda);
        top += weight * (u.step(t)[std::size_t(i)] - p.initial.step(t)[std::size_t(i)]);
        bottom += weight;
      }
      mean.step(t)[std::size_t(i)] += top / bottom;
    }
  }
  return mean;
}

TEST_F(PbstoTest, CostWeightedMeanEqualsEq58) {
  options.update = PbstoOptions::Update::kCostWeighted;
  for (const double lambda : {5.0, 50.0, 1e6}) {
    options.lambda = lambda;
    pool.batches.clear();
    const Problem p = problem(1);
    (void)planned(p);
    // The mean is scored as a batch of one, whether or not it is better.
    ASSERT_EQ(pool.batches.size(), 3u);
    const ControlSequence wanted = eq_5_8(pool, p, law(p, 0), options.rollouts, lambda);
    const ControlSequence& mean = pool.batches[2].nominal;
    ASSERT_EQ(mean.values.size(), wanted.values.size());
    for (std::size_t i = 0; i < mean.values.size(); ++i) EXPECT_NEAR(mean.values[i], wanted.values[i], 1e-12);
    EXPECT_FALSE(pool.batches[1].stop_losers);  // weights need every cost
  }
}

TEST_F(PbstoTest, CostWeightedMeanStaysFiniteForCostsThatUnderflow) {
  options.update = PbstoOptions::Update::kCostWeighted;
  options.lambda = 1e-6;
  pool.scale = 1e9;
  const Plan plan = planned(problem(3));
  for (const double u : plan.controls.values) EXPECT_TRUE(std::isfinite(u));
  EXPECT_LE(plan.cost, pool.cost(problem(1).initial));
}

TEST_F(PbstoTest, CountsRolloutsAndIterations) {
  options.rollouts = 6;
  const Plan plan = planned(problem(4));
  std::uint64_t asked = 0;
  for (const auto& batch : pool.batches) asked += batch.samples;
  EXPECT_EQ(plan.rollouts, asked);
  EXPECT_EQ(news.back().rollouts, asked);
  EXPECT_EQ(news.back().iteration, 4);
  EXPECT_EQ(final_x.back(), plan.states.back().q[0]);
}

TEST_F(PbstoTest, ScoresOnlyWhenNoIterationIsAllowed) {
  const Plan plan = planned(problem(0));
  EXPECT_EQ(plan.controls, problem(0).initial);
  EXPECT_NEAR(plan.cost, pool.cost(plan.controls), 1e-9);
  EXPECT_EQ(pool.batches.size(), 1u);
}

TEST_F(PbstoTest, PlansWithinTheLimitsEvenFromAnInitialCandidateBeyondThem) {
  Problem p = problem(2);
  for (double& u : p.initial.values) u = 5.0;
  const Plan plan = planned(p);
  for (int t = 0; t < plan.controls.steps(); ++t) {
    for (std::size_t i = 0; i < 4; ++i) EXPECT_LE(std::abs(plan.controls.step(t)[i]), options.limit[i]);
  }
}

TEST_F(PbstoTest, AsksForFullPhysicsUnlessItsOptionsSaySo) {
  planned(problem(2));
  for (const auto& batch : pool.batches) {
    EXPECT_EQ(batch.fidelity, physics_pool::Fidelity{});
    EXPECT_FALSE(batch.stop_hopeless);
    EXPECT_TRUE(batch.law.draws.empty());
  }
  pool.batches.clear();
  options.freeze = options.stop_hopeless = true;
  planned(problem(2));
  for (const auto& batch : pool.batches) {
    EXPECT_EQ(batch.fidelity, (physics_pool::Fidelity{.freeze = true}));
    EXPECT_TRUE(batch.stop_hopeless);
  }
}

// Where long steps rank as well as the fine model, screening 4·2 draws and running
// 2 of them again finds what running all 8 finds.
TEST_F(PbstoTest, ScreeningByAPerfectRankFindsWhatTheWholeBatchFinds) {
  options.rollouts = 8;
  const Plan whole = planned(problem(6));
  options.rollouts = 2;
  options.screening = 4;
  const Plan screened = planned(problem(6));
  EXPECT_EQ(screened.controls, whole.controls);
  EXPECT_EQ(screened.rollouts, 1u + 6 * (8 + 2));
}

TEST_F(PbstoTest, ScreensWithLongStepsAndChoosesWithTheFineModel) {
  options.rollouts = 2;
  options.screening = 4;
  options.screening_time_step = 0.01;
  options.freeze = true;
  planned(problem(1));
  ASSERT_EQ(pool.batches.size(), 3u);  // initial, screening, fine
  const auto& coarse = pool.batches[1];
  EXPECT_EQ(coarse.samples, 8u);
  EXPECT_EQ(coarse.fidelity, (physics_pool::Fidelity{.freeze = true, .time_step = 0.01}));
  EXPECT_FALSE(coarse.stop_losers);
  const auto& fine = pool.batches[2];
  EXPECT_EQ(fine.samples, 2u);
  EXPECT_EQ(fine.fidelity, (physics_pool::Fidelity{.freeze = true}));
  ASSERT_EQ(fine.law.draws.size(), 2u);
  std::vector<std::pair<double, std::uint32_t>> ranked;
  for (std::uint32_t k = 0; k < 8; ++k)
    ranked.emplace_back(pool.cost(sample_controls(coarse.nominal, coarse.law, k)), k);
  std::ranges::sort(ranked);
  EXPECT_THAT(fine.law.draws, testing::UnorderedElementsAre(ranked[0].second, ranked[1].second));
}

TEST_F(PbstoTest, TheFirstSuccessOfTheScreeningIsAlwaysRunAgain) {
  pool.can_succeed = true;
  options.rollouts = 1;
  options.screening = 64;
  objective.success_cost = 0.9 * pool.cost(problem(1).initial);
  planned(problem(1));
  ASSERT_EQ(pool.batches.size(), 3u);
  const auto& coarse = pool.batches[1];
  std::uint32_t first = 0;
  while (pool.cost(sample_controls(coarse.nominal, coarse.law, first)) > objective.success_cost) ++first;
  EXPECT_THAT(pool.batches[2].law.draws, testing::ElementsAre(first));
}

TEST_F(PbstoTest, ScreeningLeavesOutWhatDiverges) {
  options.rollouts = 3;
  options.screening = 2;
  pool.diverges = [](const auto& batch, std::uint32_t sample) { return batch.fidelity.time_step > 0 && sample != 4; };
  planned(problem(1));
  ASSERT_EQ(pool.batches.size(), 3u);
  EXPECT_THAT(pool.batches[2].law.draws, testing::ElementsAre(4u));
  EXPECT_EQ(pool.batches[2].samples, 1u);

  pool.batches.clear();
  pool.diverges = [](const auto& batch, std::uint32_t) { return batch.fidelity.time_step > 0; };
  EXPECT_EQ(planned(problem(2)).iterations, 2);
  EXPECT_EQ(pool.batches.size(), 3u);  // nothing to run again
}

bool is_full(const physics_pool::RolloutBatch& batch) { return batch.fidelity == physics_pool::Fidelity{}; }

TEST_F(PbstoTest, SuccessOfReducedPhysicsCountsOnceFullPhysicsAgrees) {
  pool.can_succeed = true;
  options.freeze = true;
  objective.success_cost = 0.5 * pool.cost(problem(1).initial);
  const Plan plan = planned(problem(50));
  EXPECT_TRUE(plan.at_goal);
  EXPECT_TRUE(is_full(pool.batches.back()));
  EXPECT_EQ(pool.batches.back().samples, 1u);
  EXPECT_EQ(std::ranges::count_if(pool.batches, is_full), 1);
  EXPECT_EQ(plan.controls, sample_controls(pool.batches.back().nominal, pool.batches.back().law, 0));
}

TEST_F(PbstoTest, SuccessThatFullPhysicsDeniesIsOneMoreCandidate) {
  pool.can_succeed = true;
  options.freeze = true;
  const double start = pool.cost(problem(1).initial);
  objective.success_cost = 0.5 * start;
  pool.extra = [=](const auto& batch) { return is_full(batch) ? 10 * start : 0.0; };
  const Plan plan = planned(problem(10));
  EXPECT_FALSE(plan.at_goal);
  EXPECT_EQ(plan.iterations, 10);
  EXPECT_LT(plan.cost, 10 * start);  // the denied ones were not kept
  EXPECT_GT(std::ranges::count_if(pool.batches, is_full), 1);
  for (std::size_t i = 1; i < news.size(); ++i) EXPECT_LE(news[i].cost, news[i - 1].cost);
  EXPECT_EQ(news.back().rollouts, plan.rollouts);
}

TEST_F(PbstoTest, DeniedSuccessDoesNotShortenTheHorizon) {
  pool.can_succeed = true;
  pool.success_steps = 2;  // of three
  options.freeze = true;
  const double start = pool.cost(problem(1).initial);
  objective.success_cost = 0.8 * start;
  pool.extra = [=](const auto& batch) { return is_full(batch) ? 0.1 * start : 0.0; };  // denied, yet cheaper
  const Plan plan = planned(problem(3));
  EXPECT_GT(plan.denials, 0);
  for (const auto& batch : pool.batches) EXPECT_EQ(batch.nominal.steps(), 3);
  if (!plan.at_goal) {
    EXPECT_EQ(plan.controls.steps(), 3);
  }
}

TEST_F(PbstoTest, DeniedSuccessThatIsStillBetterIsKeptAtItsTrueCost) {
  pool.can_succeed = true;
  options.freeze = true;
  const double start = pool.cost(problem(1).initial);
  objective.success_cost = 0.6 * start;
  pool.extra = [=](const auto& batch) { return is_full(batch) ? 0.2 * start : 0.0; };
  planned(problem(12));
  bool kept = false;
  for (std::size_t i = 1; i < news.size(); ++i) {
    kept = kept || (!news[i].at_goal && news[i].cost > objective.success_cost && news[i].cost < news[i - 1].cost);
  }
  EXPECT_TRUE(kept);
}

}  // namespace
}  // namespace jostle::planners
