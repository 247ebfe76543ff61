#include "services/studies/bench/convergence.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "physics_pool/scenarios/chapter3.hpp"
#include "tests/support/bowl_pool.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::studies {
namespace {

using physics_pool::Scene;

// A bowl, in which seeds and rules still matter.
class ConvergenceTest : public testing::Test {
 protected:
  ConvergenceTest() {
    for (const std::uint64_t seed : {1u, 2u}) {
      scenes.push_back(*physics_pool::generate_chapter3({.objects = 0, .seed = seed}));
    }
    options.rollouts = 50;
    options.batch = 8;
    options.seeds = {3, 4};
  }

  std::vector<Curve> measured() {
    auto result = measure_convergence(pool, scenes, options);
    if (!result) {
      ADD_FAILURE() << result.error().message;
      return {};
    }
    return std::move(result).value();
  }

  tests::BowlPool pool{{0.08, -0.05, 0.2, 0.01}};
  std::vector<Scene> scenes;
  ConvergenceOptions options;
};

TEST_F(ConvergenceTest, LetsAllSearchEveryWorldWithEverySeedInTurns) {
  const std::vector<Curve> curves = measured();
  ASSERT_EQ(curves.size(), 2u * 2u * 6u);
  std::size_t i = 0;
  for (const Scene& scene : scenes) {
    for (const std::uint64_t seed : options.seeds) {
      for (const Contender& contender : options.contenders) {
        EXPECT_EQ(curves[i].world, scene.name);
        EXPECT_EQ(curves[i].seed, seed);
        EXPECT_EQ(curves[i].method, contender.name);
        ++i;
      }
    }
  }
}

TEST_F(ConvergenceTest, SpendsTheBudgetAndNoFurtherIteration) {
  for (const Curve& curve : measured()) {
    EXPECT_EQ(curve.points.front().rollouts, 1u);
    EXPECT_GE(curve.points.back().rollouts, options.rollouts);
    EXPECT_LT(curve.points[curve.points.size() - 2].rollouts, options.rollouts);
    for (std::size_t i = 1; i < curve.points.size(); ++i) {
      EXPECT_GT(curve.points[i].rollouts, curve.points[i - 1].rollouts);
      EXPECT_GE(curve.points[i].seconds, curve.points[i - 1].seconds);
      EXPECT_LE(curve.points[i].cost, curve.points[i - 1].cost);
    }
  }
}

TEST_F(ConvergenceTest, AllBeginWithTheStraightLineAndItsCost) {
  const std::vector<Curve> curves = measured();
  for (std::size_t i = 0; i < curves.size(); ++i) {
    EXPECT_EQ(curves[i].points.front().cost, curves[i / 12 * 12].points.front().cost);  // twelve in each world
  }
}

TEST_F(ConvergenceTest, AllBeginWithNoiseOfTheSameVariance) {
  scenes.resize(1);
  options.seeds = {3};
  options.rollouts = 2;
  (void)measured();
  std::vector<double> variances;
  for (const auto& batch : pool.batches) {
    if (batch.samples == 1 || batch.law.stream > 0) continue;  // the second one is refused
    double squares = 0.0;
    for (const double scale : batch.law.scales) squares += std::pow(scale * batch.law.sigma[0], 2);
    variances.push_back(squares / static_cast<double>(batch.law.scales.size()));
  }
  ASSERT_EQ(variances.size(), 7u);  // one before anything is measured
  EXPECT_THAT(variances, testing::Each(testing::DoubleNear(variances[0], 1e-12)));
}

TEST_F(ConvergenceTest, NobodyEndsEarly) {
  pool.can_succeed = true;
  options.objective.success_cost = 1e9;
  for (const Curve& curve : measured()) EXPECT_GE(curve.points.back().rollouts, options.rollouts);
}

TEST_F(ConvergenceTest, SetsFidelityWherePlannersAskForNone) {
  options.fidelity = {.freeze = true, .time_step = 0.005};
  (void)measured();
  for (const auto& batch : pool.batches) EXPECT_EQ(batch.fidelity, options.fidelity);
}

TEST_F(ConvergenceTest, TellsHowFarItIs) {
  std::vector<std::size_t> done;
  ASSERT_TRUE(measure_convergence(pool, scenes, options, [&done](const Curve&, std::size_t n, std::size_t total) {
    EXPECT_EQ(total, 24u);
    done.push_back(n);
  }));
  EXPECT_EQ(done.size(), 24u);
  EXPECT_EQ(done.back(), 24u);
}

TEST_F(ConvergenceTest, EndsWhenAsked) {
  std::stop_source stop;
  const auto result = measure_convergence(
      pool, scenes, options,
      [&stop](const Curve&, std::size_t n, std::size_t) {
        if (n == 3) stop.request_stop();
      },
      stop.get_token());
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Code::kCancelled);
}

TEST_F(ConvergenceTest, PassesErrorsOn) {
  pool.fail_at = 5;
  const auto failed = measure_convergence(pool, scenes, options);
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().message, "bowl: told to fail");
  EXPECT_EQ(measure_convergence(pool, {}, options).error().code, Code::kInvalidArgument);
}

Curve made_up(const std::string& method, std::vector<CurvePoint> points) {
  return {.method = method, .world = "w", .seed = 1, .points = std::move(points)};
}

// Costs relative to the first, at rollouts 1, 10 and 100.
TEST(ConvergenceSummary, QuartilesOfStaircasesOnACommonGrid) {
  const std::vector<Curve> curves{made_up("a", {{1, 0.1, 100}, {9, 0.2, 50}, {100, 0.3, 10}}),  // 1, 0.5, 0.1
                                  made_up("a", {{1, 0.1, 10}, {11, 0.2, 4}, {90, 0.3, 2}}),  // 1, 1, 0.2: ended at 90
                                  made_up("a", {{1, 0.1, 1}, {10, 0.2, 0.7}, {100, 0.3, 0.6}}),  // 1, 0.7, 0.6
                                  made_up("b", {{1, 0.1, 2}, {10, 0.2, 1}})};
  const std::vector<Summary> sut = summarize(curves, Spent::kRollouts, 3);
  ASSERT_EQ(sut.size(), 2u);
  EXPECT_EQ(sut[0].method, "a");
  EXPECT_EQ(sut[1].method, "b");
  using testing::DoubleNear;
  EXPECT_THAT(sut[0].x, testing::ElementsAre(1.0, DoubleNear(10, 1e-9), 100.0));
  EXPECT_THAT(sut[0].median, testing::ElementsAre(1.0, DoubleNear(0.7, 1e-12), DoubleNear(0.2, 1e-12)));
  EXPECT_THAT(sut[0].low, testing::ElementsAre(1.0, DoubleNear(0.6, 1e-12), DoubleNear(0.15, 1e-12)));
  EXPECT_THAT(sut[0].high, testing::ElementsAre(1.0, DoubleNear(0.85, 1e-12), DoubleNear(0.4, 1e-12)));
  EXPECT_EQ(sut[1].x.back(), 10.0);
}

TEST(ConvergenceSummary, SecondsBeginAtOneAndEndAtTheMedian) {
  const std::vector<Curve> curves{made_up("a", {{1, 0.01, 8}, {2, 1.0, 4}}), made_up("a", {{1, 0.04, 8}, {2, 4.0, 2}}),
                                  made_up("a", {{1, 0.02, 8}, {2, 2.0, 6}})};
  const Summary sut = summarize(curves, Spent::kSeconds, 5).at(0);
  EXPECT_EQ(sut.x.front(), 0.01);
  EXPECT_EQ(sut.median.front(), 1.0);
  EXPECT_EQ(sut.x.back(), 2.0);
  EXPECT_EQ(sut.median.back(), 0.75);  // 0.5, not yet, 0.75
}

TEST(ConvergenceSummary, LeavesOutWhatHasNothingToCompareWith) {
  const std::vector<Curve> curves{made_up("a", {{1, 0.1, physics_pool::kInfinity}, {2, 0.2, 4}}), made_up("b", {})};
  EXPECT_TRUE(summarize(curves, Spent::kRollouts).empty());
}

TEST(ConvergenceJson, HasColumnsPerCurve) {
  const nlohmann::json sut = to_json({made_up("a", {{1, 0.5, physics_pool::kInfinity}, {9, 1.5, 4.25}})});
  EXPECT_EQ(sut, nlohmann::json::parse(R"({"curves": [{"method": "a", "world": "w", "seed": 1,
      "rollouts": [1, 9], "seconds": [0.5, 1.5], "cost": [null, 4.25]}]})"));
}

TEST(ConvergencePlot, DrawsWhatWasMeasured) {
  const tests::TempFolder folder;
  const auto drawn =
      plot_convergence({made_up("a", {{1, 0.1, 8}, {20, 0.9, 2}}), made_up("b", {{1, 0.1, 8}, {20, 1.9, 3}})},
                       folder.path() / "curves.png");
  ASSERT_TRUE(drawn) << drawn.error().message;
  EXPECT_GT(std::filesystem::file_size(folder.path() / "curves.png"), 10'000u);
}

}  // namespace
}  // namespace jostle::studies
