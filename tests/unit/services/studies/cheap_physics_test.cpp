#include "services/studies/bench/cheap_physics.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "physics_pool/local/thread_pool.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::studies {
namespace {

using ::testing::HasSubstr;

TEST(RankCorrelation, IsOneForTheSameOrderAndMinusOneForTheReverse) {
  const std::vector<double> values{3, 1, 4, 15, 9};
  EXPECT_DOUBLE_EQ(rank_correlation(values, {30, 1, 31, 1e9, 500}), 1.0);
  EXPECT_DOUBLE_EQ(rank_correlation(values, {-3, -1, -4, -15, -9}), -1.0);
}

// By the textbook: 1 - 6·sum d^2/(n(n^2-1)) without ties.
TEST(RankCorrelation, IsSpearmans) {
  EXPECT_NEAR(rank_correlation({1, 2, 3, 4, 5}, {2, 1, 4, 3, 5}), 1 - 6.0 * 4 / (5 * 24), 1e-12);
}

// Ranks 1.5, 1.5, 3, 4 against 1, 2, 3, 4: covariance 4.5, variances 4.5 and 5.
TEST(RankCorrelation, GivesTiesTheirMeanRank) {
  EXPECT_NEAR(rank_correlation({7, 7, 8, 9}, {1, 2, 3, 4}), 4.5 / std::sqrt(4.5 * 5), 1e-12);
}

TEST(RankCorrelation, IsUndefinedWithoutOrder) {
  EXPECT_TRUE(std::isnan(rank_correlation({}, {})));
  EXPECT_TRUE(std::isnan(rank_correlation({1, 1, 1}, {1, 2, 3})));
}

TEST(UsualLevers, PullOneEachAndThenAll) {
  planners::PbstoOptions shipped;
  shipped.rollouts = 3;
  shipped.screening = 5;
  shipped.freeze = shipped.stop_hopeless = true;
  const auto sut = usual_levers(shipped);
  ASSERT_EQ(sut.size(), 5u);
  const auto& plain = sut[0].options;
  EXPECT_EQ(plain.rollouts, 8);
  EXPECT_EQ(plain.screening, 1);
  EXPECT_FALSE(plain.freeze || plain.stop_hopeless);
  EXPECT_TRUE(sut[1].options.freeze);
  EXPECT_EQ(sut[1].options.screening, 1);
  EXPECT_EQ(sut[2].options.screening, 5);
  EXPECT_FALSE(sut[2].options.freeze);
  EXPECT_TRUE(sut[3].options.stop_hopeless);
  EXPECT_EQ(sut[4].options.rollouts, 3);
}

// The whole study, as small as it gets: what must hold however fast the machine is.
TEST(CheapPhysics, ComparesEveryLeverWithFullPhysics) {
  physics_pool::ThreadPool pool(2);
  planners::PbstoOptions shipped;
  shipped.rollouts = shipped.screening = 2;
  shipped.freeze = shipped.stop_hopeless = true;
  shipped.step_duration = 0.5;
  CheapPhysicsOptions options{.levers = usual_levers(shipped),
                              .sizes = {2},
                              .worlds = 1,
                              .repeats = 1,
                              .iterations = 1,
                              .samples = 6,
                              .executed_objects = 2,
                              .executed_worlds = 2,
                              .demo = {tests::target_only()},
                              .demo_seeds = 1};
  options.control.step_duration = 0.5;
  options.control.many_iterations = 2;

  const auto results = measure_cheap_physics(pool, options, {});

  ASSERT_TRUE(results) << results.error().message;
  ASSERT_EQ(results->levers.size(), 5u);
  const LeverResult &plain = results->levers[0], &hopeless = results->levers[3];
  EXPECT_EQ(plain.name, "plain");
  ASSERT_FALSE(plain.ratios.empty());
  ASSERT_FALSE(plain.pose_errors.empty());
  EXPECT_THAT(plain.ratios, testing::Each(1.0));
  EXPECT_THAT(plain.pose_errors, testing::Each(0.0));
  EXPECT_EQ(plain.executed, plain.planned);  // the full model predicts itself
  EXPECT_EQ(hopeless.same_plans, 2);
  EXPECT_EQ(results->demo.size(), 5u);
  const nlohmann::json json = to_json(*results);
  for (const auto& lever : json["levers"]) {
    for (const char* key : {"name", "objects", "candidates_ratio", "rank_correlation", "success_rate"}) {
      EXPECT_TRUE(lever.contains(key)) << key;
    }
    EXPECT_EQ(lever["objects"], 2);
    EXPECT_GT(lever["candidates_ratio"], 0.0);
  }
  EXPECT_THAT(to_text(*results), HasSubstr("candidates/s"));
}

TEST(CheapPhysics, ShowsNoNumbersOfWhatWasNotMeasured) {
  physics_pool::ThreadPool pool(1);
  const CheapPhysicsOptions options{.levers = {{"plain", {.rollouts = 1, .step_duration = 0.5}}},
                                    .parts = {"speed"},
                                    .sizes = {2},
                                    .worlds = 1,
                                    .repeats = 1,
                                    .iterations = 1};
  const auto results = measure_cheap_physics(pool, options, {});
  ASSERT_TRUE(results) << results.error().message;
  const nlohmann::json lever = to_json(*results)["levers"][0];
  for (const char* key : {"rank_correlation", "pose_error_median", "pose_error_90", "success_rate", "plan_time_ratio"})
    EXPECT_TRUE(lever[key].is_null()) << key;
  EXPECT_TRUE(lever["success_interval"][0].is_null());
  EXPECT_THAT(to_text(*results), testing::ContainsRegex("plain +2 +1[.]00 +- +-\n"));
  EXPECT_THAT(to_text(*results), testing::Not(HasSubstr("grasps")));
}

TEST(CheapPhysics, EndsWhenAskedTo) {
  physics_pool::ThreadPool pool(1);
  CheapPhysicsOptions options{.levers = usual_levers({})};
  std::stop_source stop;
  stop.request_stop();
  const auto results = measure_cheap_physics(pool, options, stop.get_token());
  ASSERT_TRUE(results);
  EXPECT_FALSE(results->complete);
  EXPECT_TRUE(results->levers.empty() || results->levers[0].ratios.empty());
}

}  // namespace
}  // namespace jostle::studies
