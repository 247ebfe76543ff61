// Which results leave together, on a clock that stands still unless told otherwise.

#include "services/pool/outbox.hpp"

#include <gmock/gmock.h>

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace pool;
using jostle_msgs::msg::AssignmentResult;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::uint64_t kAnna = 1, kBert = 2;
constexpr auto kGather = 10ms;

class OutboxTest : public ::testing::Test {
 protected:
  void put(std::uint64_t client, std::uint32_t sample, Left left) {
    AssignmentResult result;
    result.sample(sample);
    sut.put(client, std::move(result), left, kGather, now);
  }

  // Samples that leave for a client now.
  std::vector<std::uint32_t> sent_to(std::uint64_t client) {
    std::vector<std::uint32_t> samples;
    for (const Outbox::Group& group : sut.take(now)) {
      if (group.client != client) continue;
      for (const AssignmentResult& result : group.results) samples.push_back(result.sample());
    }
    return samples;
  }

  Outbox sut;
  TimePoint now = TimePoint{} + 1h;
};

TEST_F(OutboxTest, FirstResultLeavesAtOnce) {
  put(kAnna, 5, Left::kWaiting);
  EXPECT_THAT(sent_to(kAnna), ElementsAre(5));
  EXPECT_EQ(sut.due(), std::nullopt);
}

TEST_F(OutboxTest, ResultsGatherForAWhile) {
  put(kAnna, 0, Left::kWaiting);
  EXPECT_THAT(sent_to(kAnna), ElementsAre(0));
  const TimePoint sent = now;

  now += 1ms;
  put(kAnna, 1, Left::kWaiting);
  put(kAnna, 2, Left::kWaiting);

  EXPECT_THAT(sent_to(kAnna), IsEmpty());
  EXPECT_EQ(sut.held(kAnna), 2u);
  EXPECT_EQ(sut.due(), sent + kGather);
  now = *sut.due();
  EXPECT_THAT(sent_to(kAnna), ElementsAre(1, 2));
  EXPECT_EQ(sut.held(kAnna), 0u);
}

TEST_F(OutboxTest, WhereThreadsGoIdleResultsWaitForTheirBurstAlone) {
  put(kAnna, 0, Left::kRunning);
  EXPECT_THAT(sent_to(kAnna), ElementsAre(0));
  put(kAnna, 1, Left::kWaiting);
  put(kAnna, 2, Left::kRunning);

  EXPECT_EQ(sut.due(), now + Outbox::kBurst);
}

TEST_F(OutboxTest, LastResultLeavesAtOnceWithAllThatWaited) {
  put(kAnna, 0, Left::kWaiting);
  EXPECT_THAT(sent_to(kAnna), ElementsAre(0));
  put(kAnna, 1, Left::kWaiting);
  put(kAnna, 2, Left::kNothing);
  EXPECT_THAT(sent_to(kAnna), ElementsAre(1, 2));
}

TEST_F(OutboxTest, ClientsDoNotWaitForEachOther) {
  put(kAnna, 0, Left::kWaiting);
  sut.take(now);
  put(kAnna, 1, Left::kWaiting);
  put(kBert, 2, Left::kWaiting);
  EXPECT_THAT(sent_to(kBert), ElementsAre(2));
  EXPECT_EQ(sut.held(kAnna), 1u);
}

TEST_F(OutboxTest, LongMessageLeavesAtOnce) {
  put(kAnna, 0, Left::kWaiting);
  sut.take(now);
  AssignmentResult result;
  result.trajectory(std::vector<double>(Outbox::kLong / sizeof(double)));

  EXPECT_TRUE(sut.put(kAnna, std::move(result), Left::kWaiting, kGather, now));

  EXPECT_EQ(sut.due(), now);
}

TEST_F(OutboxTest, SaysWhetherSomethingHasToLeaveSooner) {
  EXPECT_TRUE(sut.put(kAnna, {}, Left::kWaiting, kGather, now));
  sut.take(now);
  EXPECT_TRUE(sut.put(kAnna, {}, Left::kWaiting, kGather, now));
  EXPECT_FALSE(sut.put(kAnna, {}, Left::kWaiting, kGather, now));
  EXPECT_TRUE(sut.put(kAnna, {}, Left::kRunning, kGather, now));
}

}  // namespace
}  // namespace jostle::tests
