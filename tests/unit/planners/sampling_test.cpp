#include "planners/sampling/sampling.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/support/bowl_pool.hpp"

namespace jostle::planners {
namespace {

using physics_pool::RolloutBatch;
using physics_pool::sample_controls;
using tests::BowlPool;
using Method = SamplingOptions::Method;

const std::vector<double> kWanted{0.08, -0.05, 0.2, 0.01};
constexpr TimePoint kNever = TimePoint::max();

class SamplingTest : public testing::Test {
 protected:
  static Problem problem(int iterations) { return tests::bowl_problem(iterations); }

  Plan planned(const Problem& p) {
    SamplingPlanner sut(pool, options, [this](const Progress& progress) { news.push_back(progress); });
    Problem asked = p;
    asked.objective = objective;
    auto plan = sut.plan(asked, kNever);
    if (!plan) {
      ADD_FAILURE() << plan.error().message;
      return {};
    }
    return std::move(plan).value();
  }

  // Batches of noisy samples, without those that scored a mean.
  std::vector<RolloutBatch> noisy() const {
    std::vector<RolloutBatch> result;
    std::ranges::copy_if(pool.batches, std::back_inserter(result), &is_noisy);
    return result;
  }

  static bool is_noisy(const RolloutBatch& batch) { return batch.samples > 1; }

  std::vector<ControlSequence> samples(const RolloutBatch& batch) const {
    std::vector<ControlSequence> result;
    for (std::uint32_t k = 0; k < batch.samples; ++k) {
      result.push_back(sample_controls(batch.nominal, batch.law, k));
    }
    return result;
  }

  std::vector<ControlSequence> cheapest_first(std::vector<ControlSequence> all) const {
    std::ranges::stable_sort(all, {}, [this](const ControlSequence& u) { return pool.cost(u); });
    return all;
  }

  BowlPool pool{kWanted};
  SamplingOptions options{.rollouts = 12};
  physics_pool::Objective objective = physics_pool::Objective::standard();
  std::vector<Progress> news;
};

void expect_near(const std::vector<double>& got, const std::vector<double>& wanted) {
  ASSERT_EQ(got.size(), wanted.size());
  for (std::size_t i = 0; i < got.size(); ++i) EXPECT_NEAR(got[i], wanted[i], 1e-12) << "at " << i;
}

ControlSequence mean_of(const std::vector<ControlSequence>& all) {
  ControlSequence mean = all.front();
  for (std::size_t j = 0; j < mean.values.size(); ++j) {
    double sum = 0.0;
    for (const ControlSequence& u : all) sum += u.values[j];
    mean.values[j] = sum / static_cast<double>(all.size());
  }
  return mean;
}

std::vector<double> deviations_of(const std::vector<ControlSequence>& all) {
  const ControlSequence mean = mean_of(all);
  std::vector<double> result(mean.values.size());
  for (std::size_t j = 0; j < result.size(); ++j) {
    double sum = 0.0;
    for (const ControlSequence& u : all) sum += std::pow(u.values[j] - mean.values[j], 2);
    result[j] = std::sqrt(sum / static_cast<double>(all.size()));
  }
  return result;
}

class SamplingMethod : public SamplingTest, public testing::WithParamInterface<Method> {
 protected:
  SamplingMethod() { options.method = GetParam(); }
};

TEST_P(SamplingMethod, ConvergesToTheWantedControl) {
  options.lambda = 1.0;
  options.rollouts = 40;
  options.sigma = {0.03, 0.03, 0.05, 0.02};
  const Plan plan = planned(problem(100));
  EXPECT_LT(plan.cost, 0.05 * pool.cost(problem(1).initial));
  for (int t = 0; t < 3; ++t) {
    for (std::size_t i = 0; i < 4; ++i) EXPECT_NEAR(plan.controls.step(t)[i], kWanted[i], 2 * options.sigma[i]);
  }
}

TEST_P(SamplingMethod, ReturnsTheCheapestSequenceEverScored) {
  const Plan plan = planned(problem(9));
  double least = physics_pool::kInfinity;
  for (const RolloutBatch& batch : pool.batches) {
    for (const ControlSequence& u : samples(batch)) least = std::min(least, pool.cost(u));
  }
  EXPECT_EQ(plan.cost, least);
  EXPECT_NEAR(pool.cost(plan.controls), least, 1e-12);
  ASSERT_EQ(news.size(), 10u);
  for (std::size_t i = 1; i < news.size(); ++i) EXPECT_LE(news[i].cost, news[i - 1].cost);
}

TEST_P(SamplingMethod, PredictsTheStatesOfItsControls) {
  const Plan plan = planned(problem(6));
  ASSERT_EQ(plan.states.size(), 4u);
  State x = problem(6).x0;
  for (int t = 0; t < 3; ++t) {
    for (std::size_t i = 0; i < 4; ++i) x.q[i] += plan.controls.step(t)[i];
    EXPECT_EQ(plan.states[static_cast<std::size_t>(t) + 1], x);
  }
}

TEST_P(SamplingMethod, RepeatsBitForBitAndDiffersForOtherSeeds) {
  const Plan a = planned(problem(6)), b = planned(problem(6));
  EXPECT_EQ(a.controls, b.controls);
  EXPECT_EQ(a.cost, b.cost);
  Problem other = problem(6);
  other.seed = 43;
  EXPECT_NE(planned(other).controls, a.controls);
}

TEST_P(SamplingMethod, UsesOneStreamPerIteration) {
  (void)planned(problem(4));
  std::vector<std::uint32_t> streams;
  for (const RolloutBatch& batch : noisy()) {
    EXPECT_EQ(batch.law.seed, 42u);
    streams.push_back(batch.law.stream);
  }
  EXPECT_THAT(streams, testing::ElementsAre(7, 8, 9, 10));
}

TEST_P(SamplingMethod, SpendsTheRolloutsThatItsOptionsSay) {
  options.rollouts = 20;
  options.elites = 0.2;
  const Plan plan = planned(problem(5));
  // The initial sequence; then 20 samples each, and the new mean of MPPI and CEM;
  // iCEM's 20·0.8^i are 20, 16, 13, 10, and then twice its four elites.
  const std::uint64_t wanted = 1 + (GetParam() == Method::kPredictive ? 5 * 20
                                    : GetParam() == Method::kIcem     ? 20 + 16 + 13 + 10 + 8
                                                                      : 5 * 21);
  EXPECT_EQ(plan.rollouts, wanted);
  EXPECT_EQ(news.back().rollouts, wanted);
  std::uint64_t asked = 0;
  for (const RolloutBatch& batch : pool.batches) asked += batch.samples;
  EXPECT_EQ(asked, wanted);
}

TEST_P(SamplingMethod, StopsAtSuccess) {
  pool.can_succeed = true;
  objective.success_cost = 0.5 * pool.cost(problem(1).initial);
  const Plan plan = planned(problem(1000));
  EXPECT_TRUE(plan.at_goal);
  EXPECT_LE(plan.cost, objective.success_cost);
  EXPECT_LT(plan.iterations, 1000);
  for (std::size_t i = 0; i + 1 < news.size(); ++i) EXPECT_FALSE(news[i].at_goal);
}

TEST_P(SamplingMethod, PassesErrorsOfThePoolOn) {
  for (const Code code : {Code::kDeadline, Code::kUnavailable, Code::kCancelled}) {
    for (const std::size_t well : {0u, 1u, 3u}) {
      BowlPool failing{kWanted};
      failing.fail_at = well;
      failing.fail_code = code;
      SamplingPlanner sut(failing, options);
      const auto plan = sut.plan(problem(10), kNever);
      ASSERT_FALSE(plan);
      EXPECT_EQ(plan.error().code, code);
      EXPECT_EQ(failing.batches.size(), well + 1);
    }
  }
}

TEST_P(SamplingMethod, SurvivesSamplesThatDiverge) {
  pool.diverges = [](const RolloutBatch& batch, std::uint32_t sample) {
    return is_noisy(batch) && (sample % 2 == 0 || batch.law.stream == 9);
  };
  const Plan plan = planned(problem(8));
  EXPECT_LT(plan.cost, pool.cost(problem(1).initial));
  for (const double u : plan.controls.values) EXPECT_TRUE(std::isfinite(u));
}

TEST_P(SamplingMethod, ReportsAnErrorWhenEverythingDiverges) {
  pool.diverges = [](const RolloutBatch&, std::uint32_t) { return true; };
  SamplingPlanner sut(pool, options);
  const auto plan = sut.plan(problem(3), kNever);
  ASSERT_FALSE(plan);
  EXPECT_THAT(plan.error().message, testing::HasSubstr("told to diverge"));
}

TEST_P(SamplingMethod, AsksForWhatItsOptionsSay) {
  options.step_duration = 0.7;
  options.min_steps = 3;
  options.limit = {1, 2, 3, 4};
  objective["goal"].weight = 77;
  options.fidelity = {.freeze = true, .time_step = 0.01};
  (void)planned(problem(2));
  for (const RolloutBatch& batch : pool.batches) {
    EXPECT_EQ(batch.step_duration, 0.7);
    EXPECT_EQ(batch.min_steps, 3);
    EXPECT_EQ(batch.law.limit, options.limit);
    EXPECT_EQ(batch.objective.weight("goal"), 77);
    EXPECT_EQ(batch.fidelity, options.fidelity);
    EXPECT_TRUE(batch.stop_on_success);
    // Among noisy samples, only predictive sampling can do without the costs of losers.
    EXPECT_EQ(batch.stop_losers, !is_noisy(batch) || GetParam() == Method::kPredictive);
    EXPECT_EQ(batch.law.persistence, is_noisy(batch) && GetParam() == Method::kIcem ? 0.7 : 0.0);
  }
}

std::string name_of(const testing::TestParamInfo<Method>& rule) {
  constexpr const char* kNames[] = {"Predictive", "Mppi", "Cem", "Icem"};
  return kNames[static_cast<int>(rule.param)];
}

INSTANTIATE_TEST_SUITE_P(Rules, SamplingMethod,
                         testing::Values(Method::kPredictive, Method::kMppi, Method::kCem, Method::kIcem), name_of);

TEST_F(SamplingTest, PredictiveSearchesAroundTheCheapestSoFar) {
  (void)planned(problem(6));
  ControlSequence best = problem(1).initial;
  for (const RolloutBatch& batch : noisy()) {
    EXPECT_EQ(batch.nominal, best);
    EXPECT_EQ(batch.law.sigma, options.sigma);
    const ControlSequence winner = cheapest_first(samples(batch)).front();
    if (pool.cost(winner) < pool.cost(best)) best = winner;
  }
}

TEST_F(SamplingTest, MppiMeanWeighsTotalCosts) {
  options.method = Method::kMppi;
  for (const double lambda : {5.0, 50.0, 1e6}) {
    options.lambda = lambda;
    pool.batches.clear();
    (void)planned(problem(2));
    const std::vector<RolloutBatch> batches = noisy();
    ASSERT_EQ(batches.size(), 2u);
    ControlSequence wanted = problem(1).initial;
    double total = 0.0;
    for (const ControlSequence& u : samples(batches[0])) {
      const double weight = std::exp(-pool.cost(u) / lambda);
      total += weight;
      for (std::size_t j = 0; j < u.values.size(); ++j) wanted.values[j] += weight * u.values[j];
    }
    for (double& value : wanted.values) value /= total;
    expect_near(batches[1].nominal.values, wanted.values);
    EXPECT_EQ(pool.batches[2].nominal, batches[1].nominal);  // the mean is scored
  }
}

TEST_F(SamplingTest, MppiStaysFiniteForCostsThatUnderflow) {
  options.method = Method::kMppi;
  options.lambda = 1e-6;
  pool.scale = 1e9;
  for (const double u : planned(problem(3)).controls.values) EXPECT_TRUE(std::isfinite(u));
}

TEST_F(SamplingTest, CemFitsMeanAndSigmaToTheElites) {
  options.method = Method::kCem;
  options.smoothing = 0.0;
  options.sigma_floor = 0.0;
  (void)planned(problem(3));
  const std::vector<RolloutBatch> batches = noisy();
  ASSERT_EQ(batches.size(), 3u);
  for (std::size_t i = 0; i + 1 < batches.size(); ++i) {
    std::vector<ControlSequence> elites = cheapest_first(samples(batches[i]));
    elites.resize(3);  // a quarter of twelve
    expect_near(batches[i + 1].nominal.values, mean_of(elites).values);
    expect_near(batches[i + 1].law.sigma, deviations_of(elites));
  }
}

TEST_F(SamplingTest, CemSmoothingLeavesPartOfTheOld) {
  options.method = Method::kCem;
  options.smoothing = 0.25;
  options.sigma_floor = 0.0;
  (void)planned(problem(2));
  const std::vector<RolloutBatch> batches = noisy();
  std::vector<ControlSequence> elites = cheapest_first(samples(batches[0]));
  elites.resize(3);
  std::vector<double> mean = mean_of(elites).values, sigma = deviations_of(elites);
  for (std::size_t j = 0; j < mean.size(); ++j) {
    mean[j] = 0.25 * batches[0].nominal.values[j] + 0.75 * mean[j];
    sigma[j] = 0.25 * options.sigma[j % 4] + 0.75 * sigma[j];
  }
  expect_near(batches[1].nominal.values, mean);
  expect_near(batches[1].law.sigma, sigma);
}

TEST_F(SamplingTest, CemSigmaShrinksToItsFloor) {
  options.method = Method::kCem;
  options.sigma_floor = 0.2;
  (void)planned(problem(40));
  const std::vector<RolloutBatch> batches = noisy();
  for (const RolloutBatch& batch : batches) {
    ASSERT_EQ(batch.law.sigma.size(), 12u);
    for (std::size_t j = 0; j < 12; ++j) EXPECT_GE(batch.law.sigma[j], 0.2 * options.sigma[j % 4]);
  }
  double left = 0.0;  // on average; a few elites that lie far apart widen single ones
  for (std::size_t j = 0; j < 12; ++j) {
    EXPECT_EQ(batches.front().law.sigma[j], options.sigma[j % 4]);
    left += batches.back().law.sigma[j] / options.sigma[j % 4] / 12;
  }
  EXPECT_LT(left, 0.3);
}

TEST_F(SamplingTest, IcemFitsToKeptElitesAsWell) {
  options.method = Method::kIcem;
  options.smoothing = 0.0;
  options.sigma_floor = 0.0;
  options.kept = 0.5;  // two of three
  (void)planned(problem(4));
  const std::vector<RolloutBatch> batches = noisy();
  ASSERT_EQ(batches.size(), 4u);
  std::vector<ControlSequence> kept;
  for (std::size_t i = 0; i + 1 < batches.size(); ++i) {
    std::vector<ControlSequence> elites = kept;
    std::ranges::copy(samples(batches[i]), std::back_inserter(elites));
    elites = cheapest_first(elites);
    elites.resize(3);
    expect_near(batches[i + 1].nominal.values, mean_of(elites).values);
    expect_near(batches[i + 1].law.sigma, deviations_of(elites));
    kept = {elites[0], elites[1]};
  }
}

}  // namespace
}  // namespace jostle::planners
