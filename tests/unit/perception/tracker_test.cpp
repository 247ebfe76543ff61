#include "perception/tracking/tracker.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>

namespace jostle::perception {
namespace {

using testing::Each;
using testing::ElementsAre;
using testing::SizeIs;

constexpr std::array<double, 4> kUpright{1, 0, 0, 0};

std::array<double, 4> turned(double angle) { return {std::cos(angle / 2), 0, 0, std::sin(angle / 2)}; }

TEST(Tracker, VelocitiesAreDifferences) {
  Tracker sut;
  EXPECT_TRUE(sut.take("can", {1, 2, 3}, turned(3.1), 5.0));
  EXPECT_TRUE(sut.take("can", {1.01, 2, 2.98}, turned(3.2), 5.1));  // past half a turn

  const auto reading = sut.readings(5.1).at(0);
  EXPECT_EQ(reading.name, "can");
  EXPECT_THAT(reading.position, ElementsAre(1.01, 2, 2.98));
  EXPECT_NEAR(reading.linear[0], 0.1, 1e-9);
  EXPECT_NEAR(reading.linear[2], -0.2, 1e-9);
  EXPECT_NEAR(reading.angular[2], 1.0, 1e-9);
}

TEST(Tracker, WhatIsMeasuredOnceOrAfterAGapIsAtRest) {
  Tracker sut;
  sut.take("can", {0, 0, 0}, kUpright, 1.0);
  EXPECT_THAT(sut.readings(1.0).at(0).linear, Each(0.0));
  sut.take("can", {1, 0, 0}, kUpright, 1.0 + 2 * Tracker::kLongestGap);
  EXPECT_THAT(sut.readings(2.0).at(0).linear, Each(0.0));
}

TEST(Tracker, WhatIsMeasuredTwiceAtOneTimeKeepsItsVelocity) {
  Tracker sut;
  sut.take("can", {0, 0, 0}, kUpright, 1.0);
  sut.take("can", {0.1, 0, 0}, kUpright, 1.1);
  sut.take("can", {0.1, 0, 0}, kUpright, 1.1);
  EXPECT_NEAR(sut.readings(1.1).at(0).linear[0], 1.0, 1e-9);
}

TEST(Tracker, WhatIsNotSeenAnyMoreStaysAtRestWhereItWas) {
  Tracker sut;
  sut.take("can", {0, 0, 0}, kUpright, 1.0);
  sut.take("can", {0.1, 0, 0}, kUpright, 1.1);
  sut.take("bowl", {5, 5, 5}, kUpright, 9.0);
  const auto readings = sut.readings(9.0);
  ASSERT_THAT(readings, SizeIs(2));
  EXPECT_EQ(readings[1].name, "can");
  EXPECT_THAT(readings[1].position, ElementsAre(0.1, 0, 0));
  EXPECT_THAT(readings[1].linear, Each(0.0));
}

TEST(Tracker, OldOnesAndNoRotationsAreDropped) {
  Tracker sut;
  EXPECT_TRUE(sut.take("can", {1, 0, 0}, kUpright, 2.0));
  EXPECT_FALSE(sut.take("can", {2, 0, 0}, kUpright, 1.9));
  EXPECT_FALSE(sut.take("can", {2, 0, 0}, {0, 0, 0, 0}, 2.1));
  EXPECT_FALSE(sut.take("can", {2, 0, 0}, {std::numeric_limits<double>::quiet_NaN(), 0, 0, 1}, 2.1));
  EXPECT_TRUE(sut.take("can", {2, 0, 0}, {2, 0, 0, 0}, 2.1));
  EXPECT_THAT(sut.readings(2.1).at(0).orientation, ElementsAre(1, 0, 0, 0));
}

}  // namespace
}  // namespace jostle::perception
