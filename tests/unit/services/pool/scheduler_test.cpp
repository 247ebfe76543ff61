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
    sut.heard({.worker = worker, .name = "w", .capacity = capacity, .ready = true, .samples = samples, .received = now},
              now);
  }

  // Time in which we listen, and hear nobody.
  void pass(std::chrono::milliseconds time) {
    for (const TimePoint end = now + time; now < end;) {
      now = std::min(now + 20ms, end);
      forgotten = sut.check_silence(now);
    }
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

  std::vector<WorkerId> forgotten;  // in the last turn that passed
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

  pass(options.silence + 1ms);
  hear(kBert);

  EXPECT_FALSE(sut.status().workers[0].alive);
  EXPECT_THAT(assigned_to(kBert), ElementsAre(0, 1));
  EXPECT_EQ(sut.status().reissued, 2u);
}

TEST_F(SchedulerTest, ResultOfTheDeadCountsWhenItIsTheFirst) {
  hear(kAnna);
  sut.start(kBatch, 0, 1);
  sut.assign(now);
  pass(options.silence + 1ms);
  hear(kBert);
  sut.assign(now);

  EXPECT_TRUE(accept(kAnna, 0));
  EXPECT_FALSE(accept(kBert, 0));
  EXPECT_EQ(sut.status().duplicates, 1u);
  EXPECT_EQ(sut.missing(kBatch), 0u);
}

TEST_F(SchedulerTest, TimeInWhichWeDidNothingIsNobodysSilence) {
  hear(kAnna);
  sut.start(kBatch, 0, 1);
  sut.assign(now);

  for (int i = 0; i < 3; ++i) {
    now += 10s;
    sut.check_silence(now);
  }

  EXPECT_TRUE(sut.status().workers[0].alive);
  pass(options.silence);
  EXPECT_FALSE(sut.status().workers[0].alive);
}

TEST_F(SchedulerTest, SilenceIsMeasuredByWhatAWorkerPromises) {
  sut.heard({.worker = kAnna, .capacity = 1, .ready = true, .period = 400ms}, now);
  pass(1900ms);
  EXPECT_TRUE(sut.status().workers[0].alive);
  pass(200ms);
  EXPECT_FALSE(sut.status().workers[0].alive);
}

TEST_F(SchedulerTest, SilenceLastsLongerWhereHeartbeatsComeLate) {
  for (int i = 0; i < 50; ++i) {
    pass(400ms);
    hear(kAnna);
  }
  pass(4 * options.silence - 200ms);
  EXPECT_TRUE(sut.status().workers[0].alive);
  pass(400ms);
  EXPECT_FALSE(sut.status().workers[0].alive);
}

TEST_F(SchedulerTest, SamplesOfTheSilentWaitUntilNothingElseIsThere) {
  hear(kAnna);
  sut.start(kBatch, 0, 5);
  EXPECT_THAT(assigned_to(kAnna), ElementsAre(0, 1));
  pass(options.silence + 1ms);
  hear(kBert);

  EXPECT_THAT(assigned_to(kBert), ElementsAre(2, 3));
  accept(kBert, 2);
  accept(kBert, 3);

  EXPECT_THAT(assigned_to(kBert), ElementsAre(4, 0));
  EXPECT_EQ(sut.status().reissued, 1u);
}

TEST_F(SchedulerTest, WhoIsHeardAgainKeepsWhatNobodyElseWasGiven) {
  hear(kAnna);
  sut.start(kBatch, 0, 5);
  EXPECT_THAT(assigned_to(kAnna), ElementsAre(0, 1));
  pass(options.silence + 1ms);
  hear(kBert);
  EXPECT_THAT(assigned_to(kBert), ElementsAre(2, 3));

  hear(kAnna, 1, 2);
  accept(kBert, 2);
  accept(kBert, 3);

  EXPECT_THAT(assigned_to(kBert), ElementsAre(4));
  EXPECT_EQ(sut.status().reissued, 0u);
  EXPECT_TRUE(accept(kAnna, 0));
  EXPECT_TRUE(accept(kAnna, 1));
}

TEST_F(SchedulerTest, SilenceLastsLongerTheMoreOfTheDeadLive) {
  hear(kAnna);
  sut.start(kBatch, 0, 200);
  for (std::uint32_t round = 0; round < 10; ++round) {  // always silent for a little too long
    const auto samples = assigned_to(kAnna);
    pass(options.silence + 20ms);
    for (const std::uint32_t sample : samples) accept(kAnna, sample);
    hear(kAnna);
  }
  sut.assign(now);

  pass(options.silence + 20ms);

  EXPECT_TRUE(sut.status().workers[0].alive);
  EXPECT_EQ(sut.status().duplicates, 0u);
}

TEST_F(SchedulerTest, CrowdIsAskedForFewerHeartbeats) {
  const auto hear_all = [&](std::chrono::milliseconds period) {
    for (WorkerId worker = 1; worker <= 256; ++worker) {
      sut.heard({.worker = worker, .capacity = 1, .ready = true, .period = period}, now);
    }
  };
  hear(kAnna);
  EXPECT_EQ(sut.period_to_ask(now), std::nullopt);
  hear_all(100ms);
  now += 1s;

  EXPECT_EQ(sut.period_to_ask(now), 400ms);
  EXPECT_EQ(sut.period_to_ask(now), std::nullopt) << "it was said just now";
  now += 1s;
  EXPECT_EQ(sut.period_to_ask(now), 400ms) << "nobody heard it";
  hear_all(400ms);
  now += 1s;
  EXPECT_EQ(sut.period_to_ask(now), std::nullopt);
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

TEST_F(SchedulerTest, AssignmentThatIsOnItsWayIsNotLost) {
  hear(kAnna);
  const TimePoint before = now;
  now += 10ms;
  sut.start(kBatch, 0, 1);
  sut.assign(now);
  const auto hear_twice = [&] {
    for (int i = 0; i < 2; ++i) {
      pass(100ms);
      sut.heard({.worker = kAnna, .capacity = 1, .ready = true, .received = before}, now);
    }
  };
  for (int i = 0; i < 10; ++i) hear_twice();
  EXPECT_THAT(assigned_to(kAnna), IsEmpty());

  for (int i = 0; i < 6; ++i) hear_twice();

  EXPECT_THAT(assigned_to(kAnna), ElementsAre(0)) << "nothing takes that long";
}

TEST_F(SchedulerTest, SampleWhoseResultIsOnItsWayIsNotLost) {
  hear(kAnna);
  sut.start(kBatch, 0, 1);
  sut.assign(now);
  for (int i = 0; i < 20; ++i) {
    pass(100ms);
    sut.heard({.worker = kAnna, .capacity = 1, .ready = true, .received = now, .all_answers_here = false}, now);
  }
  EXPECT_THAT(assigned_to(kAnna), IsEmpty());
  EXPECT_TRUE(accept(kAnna, 0));
}

TEST_F(SchedulerTest, WorkerHoldsAsManyMoreAsRunWhileMessagesTravel) {
  hear(kAnna, 64);
  sut.start(kBatch, 0, 10'000);
  EXPECT_THAT(assigned_to(kAnna), SizeIs(65));
  for (std::uint32_t sample = 0; sample < 300; ++sample) {
    sut.assign(now);
    now += 1ms;
    hear(kAnna, 64, 64);
  }
  for (std::uint32_t sample = 0; sample < 64; ++sample) {  // 5 ms of 300 on the way
    sut.accept(kAnna, kBatch, sample, 100, now, {.ran = 50ms, .there = 295ms});
  }

  EXPECT_THAT(assigned_to(kAnna), SizeIs(64 + 38 - 1))
      << "38 of 64 end in twice the way of 5 ms and 10 of gathering; one is there";
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
  sut.accept(kAnna, kBatch, 0, 100, now, {.ran = 1ms});
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
  sut.accept(kAnna, kBatch, 0, 100, now, {.ran = 60ms});
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
  pass(options.remember + 20ms);

  EXPECT_THAT(forgotten, ElementsAre(kAnna));
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
