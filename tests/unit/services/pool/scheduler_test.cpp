// Who runs what, on a clock that stands still unless told otherwise.

#include "services/pool/client/scheduler.hpp"

#include <gmock/gmock.h>

#include <map>

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace pool;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr WorkerId kAnna = 1, kBert = 2;
constexpr Epoch kBatch = 10, kOther = 11;

class SchedulerTest : public ::testing::Test {
 protected:
  void hear(WorkerId worker, int capacity = 1, std::uint32_t samples = 0) {
    sut.heard({.worker = worker, .name = "w", .capacity = capacity, .ready = true, .samples = samples}, now);
  }

  // Samples handed to a worker now.
  std::vector<std::uint32_t> assigned_to(WorkerId worker) {
    std::vector<std::uint32_t> samples;
    for (const Assignment& assignment : sut.assign(now)) {
      if (assignment.worker != worker) continue;
      samples.insert(samples.end(), assignment.samples.begin(), assignment.samples.end());
    }
    return samples;
  }

  bool accept(WorkerId worker, std::uint32_t sample) { return sut.accept(worker, kBatch, sample, 100, now); }

  const SchedulerOptions options;
  Scheduler sut{options};
  TimePoint now = TimePoint{} + 1h;
};

TEST_F(SchedulerTest, GivesOneSampleMoreThanAWorkerCanRun) {
  hear(kAnna, 3);
  sut.start(kBatch, 5, 10);

  EXPECT_THAT(assigned_to(kAnna), ElementsAre(5, 6, 7, 8));
  EXPECT_THAT(assigned_to(kAnna), IsEmpty());
  accept(kAnna, 6);
  EXPECT_THAT(assigned_to(kAnna), ElementsAre(9));
}

TEST_F(SchedulerTest, GivesNothingToAWorkerThatDoesNotHearUs) {
  sut.heard({.worker = kAnna, .capacity = 4, .ready = false}, now);
  sut.start(kBatch, 0, 4);

  EXPECT_THAT(sut.assign(now), IsEmpty());
  EXPECT_EQ(sut.usable_workers(now), 0);
}

TEST_F(SchedulerTest, FillsThreadsBeforeSpares) {
  hear(kAnna);
  hear(kBert);
  sut.start(kBatch, 0, 2);

  const auto assignments = sut.assign(now);

  ASSERT_THAT(assignments, SizeIs(2));
  EXPECT_NE(assignments[0].worker, assignments[1].worker);
}

TEST_F(SchedulerTest, ReissuesTheSamplesOfASilentWorker) {
  hear(kAnna);
  sut.start(kBatch, 0, 2);
  EXPECT_THAT(assigned_to(kAnna), ElementsAre(0, 1));

  now += options.silence + 1ms;
  hear(kBert);
  sut.check_silence(now);

  EXPECT_FALSE(sut.status().workers[0].alive);
  EXPECT_THAT(assigned_to(kBert), ElementsAre(0, 1));
  EXPECT_EQ(sut.status().reissued, 2u);
}

TEST_F(SchedulerTest, ResultOfTheDeadCountsWhenItIsTheFirst) {
  hear(kAnna);
  sut.start(kBatch, 0, 1);
  sut.assign(now);
  now += options.silence + 1ms;
  hear(kBert);
  sut.check_silence(now);
  sut.assign(now);

  EXPECT_TRUE(accept(kAnna, 0));
  EXPECT_FALSE(accept(kBert, 0));
  EXPECT_EQ(sut.status().duplicates, 1u);
  EXPECT_EQ(sut.missing(kBatch), 0u);
}

TEST_F(SchedulerTest, TakesLeaveAtOnce) {
  hear(kAnna);
  hear(kBert);
  sut.start(kBatch, 0, 4);
  sut.assign(now);

  hear(kAnna, 0);
  accept(kBert, 1);
  accept(kBert, 3);

  EXPECT_THAT(assigned_to(kBert), ElementsAre(0, 2));
}

TEST_F(SchedulerTest, ReissuesWhatAWorkerTwiceSaysItDoesNotHave) {
  hear(kAnna);
  sut.start(kBatch, 0, 1);
  sut.assign(now);

  now += options.lost_after + 1ms;
  hear(kAnna);
  EXPECT_THAT(assigned_to(kAnna), IsEmpty());
  now += 100ms;
  hear(kAnna);

  EXPECT_THAT(assigned_to(kAnna), ElementsAre(0));
}

TEST_F(SchedulerTest, KeepsWaitingForWhatAWorkerSaysItHas) {
  hear(kAnna);
  sut.start(kBatch, 0, 1);
  sut.assign(now);
  for (int i = 0; i < 20; ++i) {
    now += 100ms;
    hear(kAnna, 1, 1);
    EXPECT_THAT(sut.assign(now), IsEmpty());
  }
}

TEST_F(SchedulerTest, IdleWorkerCopiesWaitingSamplesFirst) {
  hear(kAnna);
  sut.start(kBatch, 0, 2);
  EXPECT_THAT(assigned_to(kAnna), ElementsAre(0, 1));  // 0 runs, 1 waits behind it
  hear(kBert);
  EXPECT_THAT(assigned_to(kBert), IsEmpty()) << "too early for copies";

  now += options.copy_after;

  EXPECT_THAT(assigned_to(kBert), ElementsAre(1));
  accept(kBert, 1);
  EXPECT_THAT(assigned_to(kBert), ElementsAre(0));
}

TEST_F(SchedulerTest, GivesMoreOfShortSamplesWhereOthersTakeTurns) {
  hear(kAnna);
  sut.start(kBatch, 0, 100);
  EXPECT_THAT(assigned_to(kAnna), ElementsAre(0, 1));
  sut.accept(kAnna, kBatch, 0, 100, now, 1ms);
  EXPECT_THAT(assigned_to(kAnna), ElementsAre(2)) << "nobody else is there";

  sut.heard({.worker = kAnna, .name = "w", .capacity = 1, .ready = true, .samples = 2, .others = 1}, now);
  EXPECT_THAT(assigned_to(kAnna), ElementsAre(3, 4, 5)) << "five of 1 ms outlast an exchange";

  sut.heard({.worker = kAnna, .name = "w", .capacity = 1, .ready = true, .samples = 5, .others = 0}, now);
  accept(kAnna, 1);
  EXPECT_THAT(assigned_to(kAnna), IsEmpty());
}

TEST_F(SchedulerTest, GivesNoMoreOfLongSamplesWhereOthersTakeTurns) {
  sut.heard({.worker = kAnna, .name = "w", .capacity = 2, .ready = true, .others = 5}, now);
  sut.start(kBatch, 0, 100);
  EXPECT_THAT(assigned_to(kAnna), ElementsAre(0, 1, 2));
  sut.accept(kAnna, kBatch, 0, 100, now, 60ms);
  EXPECT_THAT(assigned_to(kAnna), ElementsAre(3));
}

TEST_F(SchedulerTest, WorkerBusyWithOthersGetsNoCopies) {
  hear(kAnna);
  sut.start(kBatch, 0, 2);
  sut.assign(now);
  now += options.copy_after;
  sut.heard({.worker = kBert, .name = "w", .capacity = 2, .ready = true, .others = 2}, now);
  EXPECT_THAT(sut.assign(now), IsEmpty());

  sut.heard({.worker = kBert, .name = "w", .capacity = 2, .ready = true, .others = 1}, now);

  EXPECT_THAT(assigned_to(kBert), ElementsAre(1));
}

TEST_F(SchedulerTest, WaitsForASampleThatItsWorkerHasNoTurnFor) {
  hear(kAnna);
  hear(kBert);
  sut.start(kBatch, 0, 2);
  sut.assign(now);
  for (int i = 0; i < 100; ++i) {  // ten seconds of others' urgent work
    now += 100ms;
    for (const WorkerId worker : {kAnna, kBert}) {
      sut.heard({.worker = worker, .name = "w", .capacity = 1, .ready = true, .samples = 1, .others = 2}, now);
    }
    EXPECT_THAT(sut.check_silence(now), IsEmpty());
    EXPECT_THAT(sut.assign(now), IsEmpty());
  }
  EXPECT_TRUE(accept(kAnna, 0));
  EXPECT_EQ(sut.status().reissued, 0u);
}

TEST_F(SchedulerTest, NoSampleHasThreeCopies) {
  hear(kAnna);
  sut.start(kBatch, 0, 1);
  sut.assign(now);
  hear(kBert);
  hear(3);
  now += options.copy_after;
  EXPECT_THAT(sut.assign(now), SizeIs(1));

  now += options.copy_after;
  EXPECT_THAT(sut.assign(now), IsEmpty());
}

TEST_F(SchedulerTest, SuccessDropsEverythingAbove) {
  hear(kAnna, 3);
  sut.start(kBatch, 0, 100);
  sut.assign(now);

  accept(kAnna, 1);
  sut.drop_above(kBatch, 1);

  EXPECT_EQ(sut.missing(kBatch), 1u);
  EXPECT_THAT(assigned_to(kAnna), IsEmpty());
  EXPECT_TRUE(accept(kAnna, 0));
  EXPECT_FALSE(accept(kAnna, 2));
}

TEST_F(SchedulerTest, BatchesTakeTurns) {
  hear(kAnna, 3);
  sut.start(kBatch, 0, 10);
  sut.start(kOther, 0, 10);

  const auto assignments = sut.assign(now);

  ASSERT_THAT(assignments, SizeIs(2));
  EXPECT_THAT(assignments[0].samples, SizeIs(2));
  EXPECT_THAT(assignments[1].samples, SizeIs(2));
}

TEST_F(SchedulerTest, UrgentBatchGoesFirstAndTheNormalOneKeepsAnEighth) {
  hear(kAnna, 15);
  sut.start(kBatch, 0, 100);
  sut.start(kOther, 0, 100, physics_pool::Priority::kUrgent);

  std::map<Epoch, std::size_t> handed_out;
  for (const Assignment& assignment : sut.assign(now)) handed_out[assignment.epoch] += assignment.samples.size();

  EXPECT_EQ(handed_out[kBatch], 2u);
  EXPECT_EQ(handed_out[kOther], 14u);
}

TEST_F(SchedulerTest, UrgentBatchAloneGetsEverything) {
  hear(kAnna, 15);
  sut.start(kOther, 0, 100, physics_pool::Priority::kUrgent);
  EXPECT_THAT(assigned_to(kAnna), SizeIs(16));
}

TEST_F(SchedulerTest, FinishedBatchFreesItsWorkers) {
  hear(kAnna);
  sut.start(kBatch, 0, 10);
  sut.assign(now);

  EXPECT_TRUE(sut.finish(kBatch)) << "samples were with a worker";
  sut.start(kOther, 0, 1);

  EXPECT_THAT(assigned_to(kAnna), ElementsAre(0));
  EXPECT_FALSE(accept(kAnna, 0));
}

TEST_F(SchedulerTest, BenchedWorkerGetsNothingForAWhile) {
  hear(kAnna);
  sut.start(kBatch, 0, 1);
  sut.assign(now);

  sut.bench(kAnna, now);

  EXPECT_THAT(assigned_to(kAnna), IsEmpty());
  now += options.bench;
  hear(kAnna);
  EXPECT_THAT(assigned_to(kAnna), ElementsAre(0));
}

TEST_F(SchedulerTest, ForgetsTheLongDead) {
  hear(kAnna);
  now += options.remember + 1s;

  EXPECT_THAT(sut.check_silence(now), ElementsAre(kAnna));
  EXPECT_THAT(sut.status().workers, IsEmpty());
}

TEST_F(SchedulerTest, ResultsOfNobodyAreCountedAndDropped) {
  sut.start(kBatch, 5, 2);

  EXPECT_FALSE(sut.accept(99, 77, 5, 0, now));
  EXPECT_FALSE(sut.accept(99, kBatch, 4, 0, now));
  EXPECT_FALSE(sut.accept(99, kBatch, 7, 0, now));
  EXPECT_EQ(sut.status().duplicates, 3u);
}

}  // namespace
}  // namespace jostle::tests
