#include "services/common/charts/statistics.hpp"

#include <gmock/gmock.h>

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

TEST(WilsonInterval, OfNoRunsSaysNothing) { EXPECT_EQ(wilson_interval(0, 0).runs, 0); }

}  // namespace
}  // namespace jostle::common
