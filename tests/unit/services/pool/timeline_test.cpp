// Intervals to rows, on clocks that are made up.

#include "services/pool/client/timeline.hpp"

#include <gmock/gmock.h>

namespace jostle::tests {
namespace {

using namespace pool;
using ::testing::DoubleNear;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kFar = 5000.0;  // s that the other machine's clock is ahead

// Sent and received 1 ms before and after the sample ran, plus what is asked for.
SampleTrace trace(const std::string& name, double from, double to, double ahead = 0.0, double delay = 0.0) {
  return {.client = 1,
          .worker = std::hash<std::string>()(name),
          .epoch = 7,
          .worker_name = name,
          .sent = from - 0.001 - delay,
          .received = to + 0.001 + delay,
          .arrived = from + ahead,
          .started = from + ahead,
          .finished = to + ahead};
}

TEST(ClockOffset, IsExactWhereTheLeastDelaysAreEqual) {
  ClockOffset sut;
  sut.add(trace("a", 1.0, 2.0, kFar, 0.5));
  sut.add(trace("a", 3.0, 4.0, kFar, 0.0));
  EXPECT_NEAR(sut.seconds(), kFar, 1e-9);
  EXPECT_NEAR(sut.error(), 0.001, 1e-9);
}

TEST(ClockOffset, ErrorIsAtMostHalfOfTheLeastDelays) {
  ClockOffset sut;
  SampleTrace slow_there = trace("a", 1.0, 2.0, kFar);
  slow_there.sent -= 0.010;
  sut.add(slow_there);
  EXPECT_NEAR(sut.error(), 0.006, 1e-9);
  EXPECT_LE(std::abs(sut.seconds() - kFar), sut.error());
}

TEST(ClockOffset, LearnsTheTwoWaysFromDifferentSamples) {
  ClockOffset sut;
  SampleTrace slow_there = trace("a", 1.0, 2.0, kFar), slow_back = slow_there;
  slow_there.sent -= 1.0;
  slow_back.received += 1.0;
  sut.add(slow_there);
  sut.add(slow_back);
  EXPECT_NEAR(sut.seconds(), kFar, 1e-9);
}

TEST(Timeline, NothingGivesNothing) {
  const Timeline sut = timeline_of({});
  EXPECT_THAT(sut.rows, IsEmpty());
  EXPECT_EQ(sut.efficiency, 0.0);
}

TEST(Timeline, OneRowPerThreadInOrderOfNames) {
  SampleTrace second = trace("w-2", 1, 2);
  second.thread = 1;
  const Timeline sut = timeline_of({trace("w-10", 1, 2), second, trace("w-2", 1, 2), trace("w-10", 3, 4)});
  ASSERT_THAT(sut.rows, SizeIs(3));
  EXPECT_EQ(sut.rows[0].worker, "w-2");
  EXPECT_EQ(sut.rows[1].thread, 1u);
  EXPECT_EQ(sut.rows[2].worker, "w-10");
  EXPECT_EQ(sut.rows[2].samples, 2);
}

TEST(Timeline, PutsAllClocksOnTheClients) {
  const Timeline sut = timeline_of({trace("a", 10, 11), trace("b", 10, 11, kFar), trace("c", 10, 11, -kFar)});
  for (const Timeline::Bar& bar : sut.bars) {
    EXPECT_THAT(bar.from, DoubleNear(0.001, 1e-9));
    EXPECT_THAT(bar.to, DoubleNear(1.001, 1e-9));
  }
  EXPECT_NEAR(sut.clock_error, 0.001, 1e-9);
}

TEST(Timeline, BusyTimeAndGaps) {
  // 0 to 10.002 s: a is busy for 3 + 4 s with 2 s in between and 1 s at the end, b never.
  SampleTrace last = trace("a", 5, 9);
  last.received = 10.001;
  const Timeline sut = timeline_of({last, trace("a", 0, 3)}, {{.name = "a"}, {.name = "b", .capacity = 1}});
  ASSERT_THAT(sut.rows, SizeIs(2));
  EXPECT_NEAR(sut.length, 10.002, 1e-9);
  EXPECT_NEAR(sut.rows[0].busy, 7.0, 1e-9);
  EXPECT_NEAR(sut.rows[0].longest_gap, 2.0, 1e-9);
  EXPECT_NEAR(sut.rows[1].longest_gap, 10.002, 1e-9);
  EXPECT_NEAR(sut.efficiency, 7.0 / 20.004, 1e-9);
}

TEST(Timeline, DroppedResultsAreCopies) {
  SampleTrace late = trace("b", 0, 1);
  late.first = false;
  const Timeline sut = timeline_of({trace("a", 0, 1), late});
  EXPECT_EQ(sut.rows[0].copies, 0);
  EXPECT_EQ(sut.rows[1].copies, 1);
  EXPECT_FALSE(sut.bars[1].first);
}

TEST(Timeline, SaysHowLongSamplesWereOnTheWayAndInLine) {
  SampleTrace waited = trace("a", 1, 2);
  waited.arrived = 0.25;
  waited.sent = 0.24;
  const Timeline sut = timeline_of({waited});
  EXPECT_NEAR(sut.in_line, 0.75, 1e-9);
  EXPECT_NEAR(sut.on_the_way, 0.011, 1e-9);
}

}  // namespace
}  // namespace jostle::tests
