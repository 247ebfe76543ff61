// The recorder's parts that need no middleware.

#include <gtest/gtest.h>

#include <thread>

#include "services/bags/listening/sequence_set.hpp"
#include "services/bags/record/sample_queue.hpp"
#include "services/bags/selection.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using bags::SampleQueue;
using bags::Selection;
using bags::SequenceSet;

TEST(Selection, WithoutGlobsTakesAllButWhatIsExcluded) {
  const Selection sut{.excluded = {"/pool/*"}};
  EXPECT_TRUE(sut.wants("/robot/status"));
  EXPECT_FALSE(sut.wants("/pool/assignment/w1"));
  EXPECT_TRUE(sut.wants("/pool"));
}

TEST(Selection, StarsGoPastSlashesAndExclusionWins) {
  const Selection sut{.topics = {"/a/*", "*pose?"}, .excluded = {"/a/b"}};
  EXPECT_TRUE(sut.wants("/a/b/c"));
  EXPECT_TRUE(sut.wants("/objects/poses"));
  EXPECT_FALSE(sut.wants("/a/b"));
  EXPECT_FALSE(sut.wants("/b"));
}

TEST(SequenceSet, CountsWhatIsMissingBetweenFirstAndLast) {
  SequenceSet sut;
  EXPECT_EQ(sut.missing(), 0u);
  for (std::uint64_t number : {7, 8, 11, 12, 20}) EXPECT_TRUE(sut.insert(number));
  EXPECT_EQ(sut.missing(), 9u);
}

TEST(SequenceSet, TakesEveryNumberOnceInWhateverOrder) {
  SequenceSet sut;
  for (std::uint64_t number : {5, 3, 4, 9, 7, 8, 6}) EXPECT_TRUE(sut.insert(number)) << number;
  for (std::uint64_t number = 3; number <= 9; ++number) EXPECT_FALSE(sut.insert(number)) << number;
  EXPECT_EQ(sut.missing(), 0u);
}

TEST(SequenceSet, ForgetsOldGapsAndNeverTakesANumberTwice) {
  SequenceSet sut;
  for (std::uint64_t number = 1; number < 10'000; number += 2) ASSERT_TRUE(sut.insert(number));
  EXPECT_FALSE(sut.insert(1));
  EXPECT_FALSE(sut.insert(2));
  EXPECT_TRUE(sut.insert(9'998));
  EXPECT_FALSE(sut.insert(9'997));
  EXPECT_EQ(sut.missing(), 9'999u - 5'001u);
}

using Moment = bags::RecordClock::Moment;

TEST(RecordClock, GoesOnEvenlyWhenTheWallClockIsSet) {
  const Moment start = Moment() + 1h;
  constexpr bags::Time kWall = 1'700'000'000'000'000'000;
  bags::RecordClock sut(kWall, start);
  bags::Time before = kWall;
  for (int i = 1; i <= 100; ++i) {
    const auto elapsed = i * 100ms;
    // Set back by 2 s after 3 s, and forward by a day after 6 s.
    const auto set = elapsed < 3s ? 0s : elapsed < 6s ? -2s : -2s + 24h;
    const auto step = sut.look(kWall + std::chrono::nanoseconds(elapsed + set).count(), start + elapsed);
    const auto wanted = i == 30 ? -2s : i == 60 ? 24h : 0s;
    EXPECT_EQ(step, wanted) << i;
    const bags::Time now = sut.at(start + elapsed);
    EXPECT_EQ(now - before, std::chrono::nanoseconds(100ms).count()) << i;
    before = now;
  }
  EXPECT_EQ(sut.set_by(), 24h - 2s);
}

TEST(RecordClock, FollowsAWallClockThatIsSlewed) {
  const Moment start = Moment() + 1h;
  bags::RecordClock sut(0, start);
  // The wall clock gains 0.1 ms per second.
  for (int i = 1; i <= 1000; ++i) {
    EXPECT_EQ(sut.look(i * 1'000'100'000ll, start + i * 1s).count(), 0);
  }
  EXPECT_EQ(sut.at(start + 1000s), 1000 * 1'000'100'000ll);
  EXPECT_EQ(sut.set_by().count(), 0);
}

const bags::RecordClock kClock;
const std::vector<std::byte> kHundred(100);

TEST(SampleQueue, CountsByTopicWhatHasNoRoomUntilTheRestIsDoneWith) {
  SampleQueue sut(2 * (100 + sizeof(bags::QueuedSample)), kClock);
  EXPECT_TRUE(sut.push(0, kHundred, 1));
  EXPECT_TRUE(sut.push(3, kHundred, 2));
  EXPECT_FALSE(sut.push(3, kHundred, 3));

  const auto taken = sut.take(std::chrono::steady_clock::now(), {});
  ASSERT_EQ(taken.size(), 2u);
  EXPECT_EQ(taken[1].topic, 3);
  EXPECT_EQ(taken[1].publish_time, 2);
  EXPECT_GE(taken[1].log_time, taken[0].log_time);
  EXPECT_FALSE(sut.push(0, kHundred, 4)) << "those taken are still in memory";
  sut.take(std::chrono::steady_clock::now(), {});
  EXPECT_TRUE(sut.push(0, kHundred, 5));

  EXPECT_EQ(sut.overflowed(3), 1u);
  EXPECT_EQ(sut.overflowed(0), 1u);
  EXPECT_EQ(sut.overflowed(7), 0u);
}

TEST(SampleQueue, WakesWhoeverWaitsForAGoodDealOrIsToldToStop) {
  SampleQueue sut(64 << 20, kClock);
  const std::vector<std::byte> large(2 << 20);
  const auto never = std::chrono::steady_clock::now() + 1h;
  {
    const std::jthread pusher([&] { sut.push(0, large, 0); });
    EXPECT_EQ(sut.take(never, {}).size(), 1u);
  }
  std::stop_source stop;
  stop.request_stop();
  EXPECT_TRUE(sut.take(never, stop.get_token()).empty());
}

TEST(SampleQueue, PushesFromManyThreadsComeOutInOrderOfTime) {
  SampleQueue sut(64 << 20, kClock);
  {
    std::vector<std::jthread> pushers;
    for (int topic = 0; topic < 4; ++topic) {
      pushers.emplace_back([&, topic] {
        for (int i = 0; i < 1000; ++i) sut.push(topic, kHundred, i);
      });
    }
  }
  const auto taken = sut.take(std::chrono::steady_clock::now(), {});
  ASSERT_EQ(taken.size(), 4000u);
  for (std::size_t i = 1; i < taken.size(); ++i) EXPECT_GE(taken[i].log_time, taken[i - 1].log_time);
}

}  // namespace
}  // namespace jostle::tests
