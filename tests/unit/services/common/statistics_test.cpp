#include "services/common/charts/statistics.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <numeric>

namespace jostle::common {
namespace {

TEST(Quantile, InterpolatesBetweenSortedNeighbours) {
  EXPECT_DOUBLE_EQ(quantile({3.0, 1.0, 2.0}, 0.0), 1.0);
  EXPECT_DOUBLE_EQ(quantile({3.0, 1.0, 2.0}, 0.5), 2.0);
  EXPECT_DOUBLE_EQ(quantile({3.0, 1.0, 2.0}, 0.75), 2.5);
  EXPECT_DOUBLE_EQ(quantile({3.0, 1.0, 2.0}, 1.0), 3.0);
}

TEST(Median, IsTheMeanOfTheMiddlePairForEvenCounts) { EXPECT_DOUBLE_EQ(median({4.0, 1.0, 2.0, 10.0}), 3.0); }

TEST(MedianInterval, IsTheWholeRangeForFewValues) {
  const Interval interval = median_interval({5.0, 1.0, 3.0});
  EXPECT_DOUBLE_EQ(interval.low, 1.0);
  EXPECT_DOUBLE_EQ(interval.high, 5.0);
}

// Tables of the sign test: at 90 % and n = 8, 15, 25 the interval leaves out
// 1, 3 and 7 values on each side.
TEST(MedianInterval, LeavesOutWhatTheSignTestAllows) {
  const std::pair<int, int> expected[] = {{8, 1}, {15, 3}, {25, 7}};
  for (const auto& [count, outside] : expected) {
    std::vector<double> values(static_cast<std::size_t>(count));
    std::iota(values.begin(), values.end(), 0.0);
    const Interval interval = median_interval(values);
    EXPECT_DOUBLE_EQ(interval.low, outside) << count;
    EXPECT_DOUBLE_EQ(interval.high, count - 1 - outside) << count;
  }
}

TEST(MedianInterval, OfOneValueIsThatValue) {
  const Interval interval = median_interval({2.0});
  EXPECT_DOUBLE_EQ(interval.low, 2.0);
  EXPECT_DOUBLE_EQ(interval.high, 2.0);
}

// Wilson's formula by hand: with none of n the upper bound is z^2/(n + z^2).
TEST(WilsonInterval, StaysBetweenNoneAndAll) {
  constexpr double z2 = 1.959964 * 1.959964;
  for (int n = 1; n <= 100; ++n) {
    const Share none = wilson_interval(0, n), all = wilson_interval(n, n);
    EXPECT_GE(none.low, 0.0) << n;
    EXPECT_NEAR(none.low, 0.0, 1e-12) << n;
    EXPECT_NEAR(none.high, z2 / (n + z2), 1e-12) << n;
    EXPECT_NEAR(all.low, n / (n + z2), 1e-12) << n;
    EXPECT_NEAR(all.high, 1.0, 1e-12) << n;
    EXPECT_LE(all.high, 1.0) << n;
  }
}

TEST(Statistics, OfNothingThereIsNoNumber) {
  EXPECT_TRUE(std::isnan(quantile({}, 0.5)));
  EXPECT_TRUE(std::isnan(median_interval({}).low));
  EXPECT_TRUE(std::isnan(mean_of({}).value));
  EXPECT_EQ(mean_of({}).count, 0);
  EXPECT_EQ(wilson_interval(0, 0).runs, 0);
  EXPECT_TRUE(std::isnan(wilson_interval(0, 0).high));
}

TEST(MeanOf, IsTheMeanWithItsInterval) {
  const Mean mean = mean_of({1.0, 2.0, 3.0});
  EXPECT_EQ(mean.count, 3);
  EXPECT_DOUBLE_EQ(mean.value, 2.0);
  EXPECT_NEAR(mean.half_width, 1.96 / std::sqrt(3.0), 1e-12);
}

TEST(MeanOf, HasNoIntervalOfOneValue) {
  EXPECT_DOUBLE_EQ(mean_of({4.0}).value, 4.0);
  EXPECT_TRUE(std::isnan(mean_of({4.0}).half_width));
}

TEST(SignTest, IsTheExactOneOfAFairCoin) {
  EXPECT_DOUBLE_EQ(sign_test(0, 0), 1.0);
  EXPECT_DOUBLE_EQ(sign_test(3, 3), 1.0);
  EXPECT_NEAR(sign_test(5, 0), 2.0 / 32, 1e-12);
  EXPECT_NEAR(sign_test(1, 7), 2.0 * (1 + 8) / 256, 1e-12);
  EXPECT_DOUBLE_EQ(sign_test(1, 7), sign_test(7, 1));
}

TEST(ToText, ShowsNoNumberWhereThereIsNone) {
  EXPECT_EQ(to_text(mean_of({1.0, 2.0, 3.0}), 1), "2.0 ± 1.1");
  EXPECT_EQ(to_text(mean_of({4.0}), 2), "4.00");
  EXPECT_EQ(to_text(mean_of({}), 2), "-");
  EXPECT_EQ(number_text(kNone, 1), "-");
  EXPECT_EQ(number_text(0.0, 2), "0.00");
  EXPECT_EQ(number_text(-0.0024, 2), "-0.002");  // what was measured is not 0
  EXPECT_EQ(number_text(0.006, 2), "0.01");
  EXPECT_EQ(number_text(HUGE_VAL, 1), "-");
  EXPECT_EQ(interval_text(0.25, 0.5), "0.25 to 0.50");
  EXPECT_EQ(interval_text(kNone, kNone), "-");
}

}  // namespace
}  // namespace jostle::common
