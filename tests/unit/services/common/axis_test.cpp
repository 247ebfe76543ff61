#include "services/common/charts/axis.hpp"

#include <gmock/gmock.h>

#include <cmath>

namespace jostle::common {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Key;
using ::testing::Pair;

TEST(LinearAxis, BeginsAndEndsAtRoundTicks) {
  const Axis axis = linear_axis({8.3, 27.1, std::nan(""), HUGE_VAL});
  EXPECT_DOUBLE_EQ(axis.low, 5.0);
  EXPECT_DOUBLE_EQ(axis.high, 30.0);
  EXPECT_THAT(axis.ticks, ElementsAre(Pair(5.0, "5"), Pair(10.0, "10"), Pair(15.0, "15"), Pair(20.0, "20"),
                                      Pair(25.0, "25"), Pair(30.0, "30")));
}

TEST(LinearAxis, HasRoomForAConstantAndForNothing) {
  const Axis constant = linear_axis({3.0, 3.0});
  EXPECT_LT(constant.low, 3.0);
  EXPECT_GT(constant.high, 3.0);
  EXPECT_LT(linear_axis({}).low, linear_axis({}).high);
  EXPECT_LT(linear_axis({0.0}).low, 0.0);
}

TEST(LinearAxis, WritesZeroAsZero) {
  for (const auto& [place, text] : linear_axis({-0.3, 0.3}).ticks) {
    if (std::abs(place) < 1e-9) {
      EXPECT_EQ(text, "0");
    }
  }
}

TEST(CountingAxis, HasTicksAtWholeNumbersOnly) {
  EXPECT_THAT(counting_axis({0, 1, 2, 3}).ticks, ElementsAre(Pair(0, "0"), Pair(1, "1"), Pair(2, "2"), Pair(3, "3")));
  EXPECT_THAT(counting_axis({4}).ticks, ElementsAre(Pair(4, "4")));
  for (const double most : {7.0, 40.0, 1234.0}) {
    const Axis axis = counting_axis({1.0, most});
    EXPECT_LE(axis.ticks.size(), 10u);
    for (const auto& [place, text] : axis.ticks) EXPECT_EQ(place, std::round(place));
  }
}

TEST(NamingAxis, HasRoomAroundEveryName) {
  const Axis axis = naming_axis({"a", "b"});
  EXPECT_EQ(axis.low, -0.5);
  EXPECT_EQ(axis.high, 1.5);
  EXPECT_THAT(axis.ticks, ElementsAre(Pair(0, "a"), Pair(1, "b")));
}

TEST(LogarithmicAxis, PutsZerosOnALineBelowAllOthers) {
  const Axis axis = logarithmic_axis({20.0, 3.0, 0.5, 0.0}, {25.0, -1.0}, "exact");
  EXPECT_THAT(axis.ticks.front(), Pair(axis.zero, "exact"));
  EXPECT_LT(axis.zero, 0.4);
  EXPECT_GT(axis.zero, axis.low);
  EXPECT_EQ(axis.place(0.0), axis.zero);
  EXPECT_EQ(axis.place(-1.0), axis.low);  // the end of an interval that goes beyond it
  EXPECT_EQ(axis.place(3.0), 3.0);
  EXPECT_TRUE(std::isnan(axis.place(std::nan(""))));
  EXPECT_GE(axis.high, 25.0);
  for (const auto& [place, text] : axis.ticks) {
    if (text != "exact") {
      EXPECT_GE(place, 0.4) << text;  // no tick of a number between the least one and the line
    }
  }
}

TEST(LogarithmicAxis, WithoutZerosHasNoLineForThem) {
  const Axis axis = logarithmic_axis({20.0, 0.5}, {}, "exact");
  EXPECT_EQ(axis.zero, 0.0);
  EXPECT_THAT(axis.ticks, Contains(Key(1.0)));
}

TEST(LogarithmicAxis, GoesDownNoMoreThanADecadeForAnInterval) {
  EXPECT_GT(logarithmic_axis({20.0, 0.5}, {1e-9}, "").low, 0.04);
}

TEST(LogarithmicAxis, HasFewTicksHoweverManyDecades) {
  for (const double least : {0.5, 1e-3, 1e-9, 1e-200}) {
    const Axis axis = logarithmic_axis({1.0, least}, {}, "");
    EXPECT_LE(axis.ticks.size(), 13u) << least;
    EXPECT_GE(axis.ticks.size(), 2u) << least;
  }
}

TEST(LogarithmicAxis, OfNothingIsAnAxis) {
  for (const std::vector<double>& values : {std::vector<double>{}, std::vector{0.0}, std::vector{-1.0}}) {
    const Axis axis = logarithmic_axis(values, {}, "0");
    EXPECT_GT(axis.low, 0.0);
    EXPECT_LT(axis.low, axis.high);
  }
}

}  // namespace
}  // namespace jostle::common
