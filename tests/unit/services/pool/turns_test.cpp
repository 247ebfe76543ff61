// Whose sample runs next, on threads that are counted and time that is made up.

#include "services/pool/worker/turns.hpp"

#include <gmock/gmock.h>

#include <map>

namespace jostle::tests {
namespace {

using namespace pool;
using physics_pool::Priority;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr std::uint64_t kAnna = 1, kBert = 2, kCora = 3;

/// A client that always has `depth` samples here, each taking `length` seconds.
struct Load {
  std::uint64_t client = 0;
  double length = 0.0;
  int depth = 2;
  Priority priority = Priority::kNormal;
};

class TurnsTest : public ::testing::Test {
 protected:
  void wait(std::uint64_t client, std::uint32_t sample, Priority priority = Priority::kNormal,
            std::uint64_t epoch = 1) {
    sut.wait({.client = client, .epoch = epoch, .sample = sample, .priority = priority});
  }

  std::uint64_t next_client() {
    const auto job = sut.next();
    if (!job) return 0;
    sut.done(*job, Turns::Duration(1.0));
    return job->client;
  }

  // Lets the loads use `threads` for `time` seconds; returns each client's seconds.
  std::map<std::uint64_t, double> share(const std::vector<Load>& loads, int threads, double time) {
    std::map<std::uint64_t, double> used;
    std::map<double, std::pair<Job, double>> running;  // by end
    const auto of = [&](std::uint64_t client) { return *std::ranges::find(loads, client, &Load::client); };
    for (const Load& load : loads) {
      for (int i = 0; i < load.depth; ++i) wait(load.client, 0, load.priority);
    }
    double now = 0.0, shift = 0.0;
    while (now < time) {
      while (static_cast<int>(running.size()) < threads) {
        const auto job = sut.next();
        if (!job) break;
        const double length = of(job->client).length;
        running.emplace(now + length + (shift += 1e-9), std::pair(*job, length));
      }
      const auto [job, length] = running.begin()->second;
      now = running.begin()->first;
      running.erase(running.begin());
      used[job.client] += length;
      wait(job.client, 0, of(job.client).priority);  // its client sends the next one
      sut.done(job, Turns::Duration(length));
    }
    return used;
  }

  Turns sut;
};

TEST_F(TurnsTest, NobodyWaitsNothingRuns) { EXPECT_FALSE(sut.next()); }

TEST_F(TurnsTest, AClientsSamplesRunInTheOrderTheyCame) {
  for (const std::uint32_t sample : {4u, 2u, 9u}) wait(kAnna, sample);
  EXPECT_EQ(sut.next()->sample, 4u);
  EXPECT_EQ(sut.next()->sample, 2u);
  EXPECT_EQ(sut.next()->sample, 9u);
}

TEST_F(TurnsTest, EqualSamplesAlternate) {
  for (std::uint32_t i = 0; i < 3; ++i) wait(kAnna, i);
  for (std::uint32_t i = 0; i < 3; ++i) wait(kBert, i);
  std::vector<std::uint64_t> order;
  for (int i = 0; i < 6; ++i) order.push_back(next_client());
  EXPECT_THAT(order, ElementsAre(kAnna, kBert, kAnna, kBert, kAnna, kBert));
}

TEST_F(TurnsTest, LongAndShortSamplesGetHalfOfTheTimeEach) {
  for (const int threads : {1, 2, 5}) {
    sut = {};
    auto used = share({{.client = kAnna, .length = 0.060, .depth = threads + 1},
                       {.client = kBert, .length = 0.005, .depth = threads + 1}},
                      threads, 20.0);
    EXPECT_NEAR(used[kAnna] / (used[kAnna] + used[kBert]), 0.5, 0.02) << threads << " threads";
  }
}

TEST_F(TurnsTest, ThreeClientsGetAThirdEachHoweverMuchTheyAskFor) {
  auto used = share({{.client = kAnna, .length = 0.060, .depth = 50},
                     {.client = kBert, .length = 0.005, .depth = 3},
                     {.client = kCora, .length = 0.013, .depth = 3}},
                    2, 30.0);
  const double sum = used[kAnna] + used[kBert] + used[kCora];
  for (const std::uint64_t client : {kAnna, kBert, kCora}) EXPECT_NEAR(used[client] / sum, 1.0 / 3, 0.02) << client;
}

TEST_F(TurnsTest, UrgentRunsFirstAndNormalGetsAnEighth) {
  auto used = share({{.client = kAnna, .length = 0.020, .depth = 50},
                     {.client = kBert, .length = 0.010, .priority = Priority::kUrgent}},
                    1, 20.0);
  EXPECT_NEAR(used[kAnna] / (used[kAnna] + used[kBert]), 1.0 / 8, 0.01);
}

TEST_F(TurnsTest, PrioritiesShareWhateverTheNumberOfClients) {
  auto used = share({{.client = kAnna, .length = 0.020, .depth = 5},
                     {.client = kCora, .length = 0.007, .depth = 5},
                     {.client = kBert, .length = 0.010, .priority = Priority::kUrgent}},
                    1, 20.0);
  const double sum = used[kAnna] + used[kBert] + used[kCora];
  EXPECT_NEAR(used[kBert] / sum, 7.0 / 8, 0.01);
  EXPECT_NEAR(used[kAnna] / sum, 1.0 / 16, 0.01);
}

TEST_F(TurnsTest, AnUrgentSampleIsNextEvenAfterLongNormalWork) {
  for (std::uint32_t i = 0; i < 30; ++i) wait(kAnna, i);
  for (int i = 0; i < 20; ++i) EXPECT_EQ(next_client(), kAnna);
  wait(kBert, 0, Priority::kUrgent);
  EXPECT_EQ(next_client(), kBert);
}

TEST_F(TurnsTest, WhoWasAwaySavedNothingUp) {
  wait(kBert, 0);
  next_client();
  for (std::uint32_t i = 0; i < 200; ++i) wait(kAnna, i);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(next_client(), kAnna);
  for (std::uint32_t i = 0; i < 100; ++i) wait(kBert, i);
  int anna = 0;
  for (int i = 0; i < 20; ++i) anna += next_client() == kAnna;
  EXPECT_NEAR(anna, 10, 1);
}

TEST_F(TurnsTest, AMomentWithoutSamplesCostsNothing) {
  // Bert has one sample here at a time: between two of them he is not waiting.
  auto used =
      share({{.client = kAnna, .length = 0.060, .depth = 2}, {.client = kBert, .length = 0.060, .depth = 1}}, 1, 20.0);
  EXPECT_NEAR(used[kBert] / (used[kAnna] + used[kBert]), 0.5, 0.02);
}

TEST_F(TurnsTest, WithdrawsOneBatchOnly) {
  wait(kAnna, 0, Priority::kNormal, 7);
  wait(kAnna, 1, Priority::kNormal, 8);
  wait(kBert, 2, Priority::kNormal, 7);
  wait(kAnna, 3, Priority::kNormal, 7);

  EXPECT_THAT(sut.withdraw(kAnna, 7), SizeIs(2));
  EXPECT_THAT(sut.withdraw(kAnna, 7), IsEmpty());

  EXPECT_EQ(sut.next()->sample, 1u);
  EXPECT_EQ(sut.next()->sample, 2u);
  EXPECT_FALSE(sut.next());
}

TEST_F(TurnsTest, SkippedSamplesCostTheirClientNothing) {
  for (std::uint32_t i = 0; i < 10; ++i) wait(kAnna, i);
  for (std::uint32_t i = 0; i < 10; ++i) wait(kBert, i);
  int anna = 0;
  for (int i = 0; i < 10; ++i) {
    const auto job = sut.next();
    if (job->client == kAnna)
      ++anna, sut.done(*job, Turns::Duration(0.0), true);
    else
      sut.done(*job, Turns::Duration(1.0));
  }
  EXPECT_GE(anna, 8);
}

TEST_F(TurnsTest, ManyWhoComeOnceAreServed) {
  for (std::uint64_t client = 10; client < 1000; ++client) {
    wait(client, 0);
    EXPECT_EQ(next_client(), client);
  }
}

}  // namespace
}  // namespace jostle::tests
