// What every Pool promises, asked of every implementation.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <future>
#include <latch>
#include <set>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/parareal/parareal_pool.hpp"
#include "services/pool/client/remote_pool.hpp"
#include "tests/support/arms.hpp"
#include "tests/support/batches.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/pushing.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace physics_pool;
using ::testing::HasSubstr;

constexpr auto kPatience = 60s;  // for what should take well under a second

/// What the suite is asked about: a robot, and two moments of it.
struct Setting {
  Scene (*scene)(std::uint64_t seed);
  void (*before_goal)(const Scene& scene, RolloutBatch& batch);     // a step ends there, with luck
  void (*before_contact)(const Scene& scene, RolloutBatch& batch);  // a step meets an object
  int ahead = kControlX;                                            // the axis that takes it to the target
};

const Setting kGripper{.scene = small_scene,
                       .before_goal =
                           [](const Scene& scene, RolloutBatch& batch) {
                             const SceneObject& target = scene.objects[static_cast<std::size_t>(scene.target())];
                             batch.x0.q[kJointX] = target.x - 0.070;  // 10 mm short of the pre-grasp region
                             batch.x0.q[kJointY] = target.y;
                             batch.nominal.step(0)[kControlX] = 0.03;
                           },
                       .before_contact =
                           [](const Scene& scene, RolloutBatch& batch) {
                             const SceneObject& target = scene.objects[static_cast<std::size_t>(scene.target())];
                             batch.x0.q[kJointX] = target.x - 0.105;  // a finger meets the target
                             batch.x0.q[kJointY] = target.y + 0.05;
                           }};

const Setting kPusher{
    .scene =
        [](std::uint64_t seed) {
          const double y = 0.01 * static_cast<double>(seed);
          return pushing_scene(-0.07, y, {slider_disc("target", 0.0, 0.0), slider_disc("other", 0.11, y)});
        },
    .before_goal =
        [](const Scene& scene, RolloutBatch& batch) {
          const SceneObject& target = scene.objects[static_cast<std::size_t>(scene.target())];
          batch.x0.q[2] = scene.task.goal.x - scene.task.goal.radius - 0.01;  // 1 cm short of the region
          batch.x0.q[3] = scene.task.goal.y;
          batch.x0.q[kJointX] = batch.x0.q[2] - target.radius - *disc_radius(scene.robot.model) - 0.001;
          batch.x0.q[kJointY] = batch.x0.q[3];
          batch.nominal.step(0)[kControlX] = 0.03;
        },
    .before_contact = [](const Scene&, RolloutBatch&) {}};  // the start is one

// An arm of seven axes and a gripper, given as URDF: small velocities of its first axis push a box.
const Setting kArm{.scene =
                       [](std::uint64_t seed) {
                         Scene scene = seven_axis_reach();
                         scene.objects[2].yaw += 0.1 * static_cast<double>(seed);  // of the one that is out of the way
                         return scene;
                       },
                   .before_goal =
                       [](const Scene& scene, RolloutBatch& batch) {
                         const auto target = static_cast<std::size_t>(layout_of(scene).objects[0].q);
                         batch.x0.q[target] -= 0.048;  // 2 mm short of being reached
                         batch.nominal.step(0)[kAxis1] = 0.0;
                         batch.nominal.step(0)[kAxis4] = -0.03;  // half a metre from the tool
                       },
                   .before_contact = [](const Scene&, RolloutBatch&) {},  // the start is one
                   .ahead = kAxis4};

struct Implementation {
  const char* name;
  int threads;            // in this process, or
  int workers;            // processes over DDS
  bool parareal = false;  // on top of them, with as many iterations as steps
  const Setting* setting = &kGripper;
};

// A pool and whatever it needs to be alive. One at a time: a process has one
// participant.
struct Rig {
  explicit Rig(const Implementation& implementation) {
    if (implementation.threads > 0) {
      engines = std::make_unique<ThreadPool>(implementation.threads);
    } else {
      find_workers(implementation);
    }
    if (implementation.parareal) {
      parareal = std::make_unique<PararealPool>(*engines, PararealOptions{.stop = {.iterations = INT_MAX}});
    }
  }

  void find_workers(const Implementation& implementation) {
    for (int i = 0; i < implementation.workers; ++i) workers.emplace_back(test_domain());
    participant = wire::Participant::open({.domain = test_domain()}).value();
    auto remote = std::make_unique<pool::RemotePool>(*participant);
    if (!remote->wait_for_workers(implementation.workers, in(kPatience))) {
      throw std::runtime_error("the workers were not found");
    }
    engines = std::move(remote);
  }

  std::vector<WorkerProcess> workers;
  std::optional<wire::Participant> participant;
  std::unique_ptr<AsyncPool> engines;
  std::unique_ptr<PararealPool> parareal;
};

// Starting workers takes longer than most tests, so consecutive tests of one
// implementation share them.
class PoolContract : public ::testing::TestWithParam<Implementation> {
 protected:
  static Rig& rig() {
    if (!rig_ || owner_ != GetParam().name) {
      rig_.reset();
      rig_ = std::make_unique<Rig>(GetParam());
      owner_ = GetParam().name;
    }
    return *rig_;
  }

  PoolContract() { EXPECT_TRUE(sut.load(scene)); }

  static int workers() { return GetParam().threads + GetParam().workers; }

  BatchReply run(const RolloutBatch& batch) {
    auto reply_result = sut.run(batch, in(kPatience));
    if (!reply_result) throw std::runtime_error(reply_result.error().message);
    return std::move(reply_result).value();
  }

  // The same batch on one thread: what every other implementation must match.
  BatchReply reference(const RolloutBatch& batch) {
    ThreadPool one(1);
    EXPECT_TRUE(one.load(scene));
    return one.run(batch, in(kPatience)).value();
  }

  static const Setting& setting() { return *GetParam().setting; }
  static Scene scene_of(std::uint64_t seed) { return setting().scene(seed); }

  const Scene scene = scene_of(1);
  AsyncPool& engines = *rig().engines;
  Pool& sut = GetParam().parareal ? static_cast<Pool&>(*rig().parareal) : engines;

 private:
  friend class EndOfRig;
  static inline std::unique_ptr<Rig> rig_;
  static inline std::string owner_;
};

// What Parareal does not promise: how much work it does, and batches left running.
class EnginePoolContract : public PoolContract {};

// Takes the last rig down before static destruction takes the middleware.
class EndOfRig : public ::testing::Environment {
  void TearDown() override { PoolContract::rig_.reset(); }
};
const auto* const kEndOfRig = ::testing::AddGlobalTestEnvironment(new EndOfRig);

// One step before the goal: noise decides which samples reach it, and stay there.
RolloutBatch almost_there(const Setting& setting, const Scene& scene) {
  RolloutBatch batch = push_batch(scene, 12);
  batch.nominal.truncate(1);
  setting.before_goal(scene, batch);
  batch.objective.success_cost = 1e9;
  batch.stop_on_success = true;
  return batch;
}

TEST_P(PoolContract, EqualRequestsGiveBitEqualReplies) {
  RolloutBatch batch = push_batch(scene, 6);
  batch.stop_losers = false;
  batch.want_all_trajectories = true;

  const BatchReply first = run(batch), second = run(batch);

  EXPECT_EQ(fingerprints(first), fingerprints(second));
  EXPECT_EQ(fingerprints(first), fingerprints(reference(batch)));
}

TEST_P(PoolContract, PriorityChangesNothingInTheReply) {
  RolloutBatch batch = push_batch(scene, 6);
  batch.stop_losers = false;
  const BatchReply normal = run(batch);
  batch.priority = Priority::kUrgent;

  EXPECT_EQ(fingerprints(run(batch)), fingerprints(normal));
}

TEST_P(PoolContract, WinnerIsTheSameWithAndWithoutStopping) {
  RolloutBatch stopping = push_batch(scene, 8), thorough = stopping;
  thorough.stop_losers = false;

  const BatchReply stopped = run(stopping), whole = run(thorough), wanted = reference(thorough);

  ASSERT_GE(wanted.winner, 0);
  EXPECT_EQ(stopped.winner, wanted.winner);
  EXPECT_EQ(winner_fingerprint(stopped), winner_fingerprint(wanted));
  EXPECT_EQ(winner_fingerprint(whole), winner_fingerprint(wanted));
}

TEST_P(PoolContract, WinnerBeatsTheIncumbentOrThereIsNone) {
  RolloutBatch batch = push_batch(scene, 4);
  const BatchReply open = run(batch);
  batch.incumbent = open.outcomes[static_cast<std::size_t>(open.winner)].cost;

  EXPECT_EQ(run(batch).winner, -1);
}

TEST_P(PoolContract, LowestSuccessfulSampleWins) {
  const RolloutBatch batch = almost_there(setting(), scene);
  // One sample at a time: no sibling can interfere.
  int lowest = -1;
  for (std::uint32_t sample = 0; sample < batch.samples && lowest < 0; ++sample) {
    RolloutBatch alone = batch;
    alone.first_sample = sample;
    alone.samples = 1;
    if (reference(alone).outcomes[0].end == End::kSucceeded) lowest = static_cast<int>(sample);
  }
  ASSERT_GT(lowest, 0) << "the batch should make its first sample fail";

  const BatchReply reply = run(batch);

  EXPECT_EQ(reply.winner, lowest);
  EXPECT_EQ(reply.outcomes[static_cast<std::size_t>(lowest)].end, End::kSucceeded);
  EXPECT_EQ(winner_fingerprint(reply), winner_fingerprint(reference(batch)));
}

TEST_P(PoolContract, SamplesAreNamedFromTheFirstOneAsked) {
  RolloutBatch whole = push_batch(scene, 5), part = whole;
  whole.stop_losers = part.stop_losers = false;
  part.first_sample = 3;
  part.samples = 2;

  const BatchReply all = run(whole), some = run(part);

  ASSERT_EQ(some.outcomes.size(), 2u);
  EXPECT_EQ(some.outcomes[0].sample, 3u);
  EXPECT_EQ(some.outcomes[0].cost, all.outcomes[3].cost);
  EXPECT_EQ(some.outcomes[1].cost, all.outcomes[4].cost);
}

TEST_P(EnginePoolContract, ReducedPhysicsGivesTheSameBitsEverywhere) {
  for (const Fidelity& fidelity : {Fidelity{.freeze = true}, Fidelity{.freeze = true, .time_step = 0.01}}) {
    RolloutBatch batch = push_batch(scene, 6);
    setting().before_contact(scene, batch);
    batch.stop_losers = false;
    batch.want_all_trajectories = true;
    batch.fidelity = fidelity;
    batch.law.draws = {3, 1, 4, 15, 9, 26};

    const BatchReply reply = run(batch), wanted = reference(batch);

    EXPECT_EQ(fingerprints(reply), fingerprints(wanted));
    std::uint32_t thawed = 0;
    for (std::size_t i = 0; i < reply.outcomes.size(); ++i) {
      EXPECT_EQ(reply.outcomes[i].thawed, wanted.outcomes[i].thawed);
      thawed += reply.outcomes[i].thawed;
    }
    EXPECT_GT(thawed, 0u);
  }
}

TEST_P(EnginePoolContract, StoppingTheHopelessNeverChangesTheWinner) {
  RolloutBatch batch = push_batch(scene, 16);
  std::ranges::fill(batch.nominal.values, 0.0);
  batch.law.sigma.assign(batch.nominal.values.size(), 0.0);  // one step there or away, then rest
  batch.law.sigma[static_cast<std::size_t>(setting().ahead)] = 0.06;
  batch.stop_on_success = true;
  const BatchReply open = run(batch);
  ASSERT_GE(open.winner, 0);
  batch.incumbent = std::nextafter(open.outcomes[static_cast<std::size_t>(open.winner)].cost, kInfinity);
  const auto engine_steps = [](const BatchReply& reply) {
    std::uint64_t sum = 0;
    for (const RolloutOutcome& outcome : reply.outcomes) sum += outcome.engine_steps;
    return sum;
  };
  const std::uint64_t without = engine_steps(reference(batch));
  batch.stop_hopeless = true;

  EXPECT_EQ(winner_fingerprint(run(batch)), winner_fingerprint(open));
  EXPECT_LT(engine_steps(reference(batch)), without);
}

TEST_P(PoolContract, NoiseIsTheSameEverywhereAndForEveryCandidate) {
  RolloutBatch batch = push_batch(scene, 6);
  batch.law.sigma.assign(batch.law.limit.size(), 0.0);  // samples differ in their noise alone
  batch.stop_losers = false;
  batch.want_all_trajectories = true;
  batch.noise = {.sigma = 0.003, .slope = 0.02, .seed = 5};
  batch.rest = 0.1;

  const BatchReply reply = run(batch);

  EXPECT_EQ(fingerprints(reply), fingerprints(reference(batch)));
  const std::vector<Hash> all = fingerprints(reply);
  EXPECT_EQ(std::set<Hash>(all.begin(), all.end()).size(), all.size());
  RolloutBatch other = batch;
  other.law.seed += 1;  // of the controls' noise, of which there is none
  EXPECT_EQ(fingerprints(run(other)), all);
  other.noise.seed += 1;
  EXPECT_NE(fingerprints(run(other)), all);
}

TEST_P(PoolContract, SeveralBatchesAtOnceReplyAsEachWouldAlone) {
  const Scene other = scene_of(2);
  ASSERT_TRUE(sut.load(other));
  std::vector<RolloutBatch> batches{push_batch(scene, 3), push_batch(other, 4), push_batch(scene, 1)};
  for (RolloutBatch& batch : batches) batch.stop_losers = false;
  batches[2].first_sample = 7;

  const auto replies_result = sut.run_all(batches, in(kPatience));

  ASSERT_TRUE(replies_result) << replies_result.error().message;
  ASSERT_EQ(replies_result->size(), batches.size());
  for (std::size_t i = 0; i < batches.size(); ++i) {
    EXPECT_EQ(fingerprints((*replies_result)[i]), fingerprints(run(batches[i]))) << i;
  }
  EXPECT_TRUE(sut.run_all({}, in(kPatience))->empty());
}

TEST_P(PoolContract, OneBadBatchOfSeveralIsTheAnswer) {
  std::vector<RolloutBatch> batches{push_batch(scene, 2), push_batch(scene, 2)};
  batches[1].samples = 0;

  const auto replies_result = sut.run_all(batches, in(kPatience));

  ASSERT_FALSE(replies_result);
  EXPECT_EQ(replies_result.error().code, Code::kInvalidArgument);
  EXPECT_THAT(replies_result.error().message, HasSubstr("samples: got 0"));
}

TEST_P(PoolContract, UnknownWorldIsAnErrorThatNamesIt) {
  RolloutBatch batch = push_batch(scene, 1);
  batch.world = {.high = 0xabad1dea, .low = 7};

  const auto reply_result = sut.run(batch, in(kPatience));

  ASSERT_FALSE(reply_result);
  EXPECT_EQ(reply_result.error().code, Code::kUnknownWorld);
  EXPECT_THAT(reply_result.error().message, HasSubstr(to_string(batch.world)));
}

TEST_P(PoolContract, BadFieldIsNamed) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  const std::pair<const char*, std::function<void(RolloutBatch&)>> cases[] = {
      {"x0.q", [](RolloutBatch& b) { b.x0.q.pop_back(); }},
      {"x0.v", [](RolloutBatch& b) { b.x0.v.push_back(0); }},
      {"x0.q[2]", [&](RolloutBatch& b) { b.x0.q[2] = kNaN; }},
      {"x0.v[0]", [](RolloutBatch& b) { b.x0.v[0] = kInfinity; }},
      {"nominal.values", [](RolloutBatch& b) { b.nominal.values.clear(); }},
      {"nominal.values[5]", [&](RolloutBatch& b) { b.nominal.values[5] = kNaN; }},
      {"nominal.values", [](RolloutBatch& b) { b.nominal.values.assign(4 * 10'001, 0.0); }},
      {"u_before", [](RolloutBatch& b) { b.u_before.clear(); }},
      {"law.sigma", [](RolloutBatch& b) { b.law.sigma.pop_back(); }},
      {"law.sigma[1]", [](RolloutBatch& b) { b.law.sigma[1] = -1; }},
      {"law.limit[0]", [](RolloutBatch& b) { b.law.limit[0] = 0; }},
      {"samples", [](RolloutBatch& b) { b.samples = 0; }},
      {"samples", [](RolloutBatch& b) { b.samples = 1'000'000'000; }},
      {"step_duration", [](RolloutBatch& b) { b.step_duration = 1e9; }},
      {"step_duration", [](RolloutBatch& b) { b.step_duration = 0.0301; }},
      {"law.stream", [](RolloutBatch& b) { b.law.stream = kSamplingStreams; }},
      {"noise.sigma", [](RolloutBatch& b) { b.noise.sigma = -1; }},
      {"noise.slope", [&](RolloutBatch& b) { b.noise.slope = kNaN; }},
      {"rest", [](RolloutBatch& b) { b.rest = -0.1; }},
      {"rest", [](RolloutBatch& b) { b.rest = 0.1234567; }},
      {"rest", [](RolloutBatch& b) { b.rest = 0.2, b.stop_hopeless = true; }},
      {"noise", [](RolloutBatch& b) { b.noise.sigma = 0.003, b.fidelity.freeze = true; }},
      {"incumbent", [&](RolloutBatch& b) { b.incumbent = kNaN; }},
      {"objective.edge", [](RolloutBatch& b) { b.objective["edge"].weight = -1; }},
      {"priority", [](RolloutBatch& b) { b.priority = static_cast<Priority>(7); }},
      {"wait", [](RolloutBatch& b) { b.wait = 1h; }},
  };
  for (const auto& [field, spoil] : cases) {
    RolloutBatch batch = push_batch(scene, 2);
    spoil(batch);
    const auto reply_result = sut.run(batch, in(kPatience));
    ASSERT_FALSE(reply_result) << field;
    EXPECT_EQ(reply_result.error().code, Code::kInvalidArgument) << field;
    EXPECT_THAT(reply_result.error().message, HasSubstr(fmt::format("{}: got", field)));
  }
  EXPECT_EQ(run(push_batch(scene, 2)).outcomes.size(), 2u);
}

TEST_P(PoolContract, ReturnsDeadlineErrorWhenTimeRunsOut) {
  const auto start = Clock::now();

  const auto reply_result = sut.run(wait_batch(scene, 4, 5s), start + 100ms);

  ASSERT_FALSE(reply_result);
  EXPECT_EQ(reply_result.error().code, Code::kDeadline);
  EXPECT_LT(Clock::now() - start, 1s);
}

TEST_P(PoolContract, CancelledBatchFreesTheWorkers) {
  std::stop_source stop;
  std::latch running(2);
  auto reply = std::async(std::launch::async, [&] {
    running.arrive_and_wait();
    return sut.run(wait_batch(scene, 8, 10s), in(kPatience), stop.get_token());
  });
  running.arrive_and_wait();
  stop.request_stop();
  ASSERT_EQ(reply.wait_for(2s), std::future_status::ready);

  const auto reply_result = reply.get();
  ASSERT_FALSE(reply_result);
  EXPECT_EQ(reply_result.error().code, Code::kCancelled);
  const auto start = Clock::now();
  run(wait_batch(scene, 4, 1ms));
  EXPECT_LT(Clock::now() - start, 1s);
}

TEST_P(PoolContract, StopRequestedBeforehandIsHonoured) {
  std::stop_source stop;
  stop.request_stop();

  for (const auto time : {std::chrono::nanoseconds(10s), 0ns}) {  // however fast the work would be done
    const auto reply_result = sut.run(wait_batch(scene, 2, time), in(kPatience), stop.get_token());
    ASSERT_FALSE(reply_result);
    EXPECT_EQ(reply_result.error().code, Code::kCancelled);
  }
}

TEST_P(PoolContract, WorkIsSpreadOverAllWorkers) {
  const PoolStatus before = sut.status();

  run(wait_batch(scene, static_cast<std::uint32_t>(6 * workers()), 20ms));

  const PoolStatus after = sut.status();
  ASSERT_EQ(after.workers.size(), static_cast<std::size_t>(workers()));
  for (std::size_t i = 0; i < after.workers.size(); ++i) {
    EXPECT_TRUE(after.workers[i].alive);
    EXPECT_GE(after.workers[i].rollouts - before.workers[i].rollouts, 3u) << after.workers[i].name;
  }
}

TEST_P(PoolContract, ManySmallBatchesEndInTime) {
  constexpr int kBatches = 200;
  const auto start = Clock::now();
  for (int i = 0; i < kBatches; ++i) run(wait_batch(scene, 4, 0ns));
  const std::chrono::duration<double, std::milli> took = Clock::now() - start;
  RecordProperty("milliseconds_per_batch", fmt::format("{:.3f}", took.count() / kBatches));
  EXPECT_LT(took, 20s);
}

TEST_P(PoolContract, TwoThreadsMayRunAtOnce) {
  const Scene other = scene_of(2);
  ASSERT_TRUE(sut.load(other));
  RolloutBatch here = push_batch(scene, 4), there = push_batch(other, 4);
  here.stop_losers = there.stop_losers = false;

  auto reply = std::async(std::launch::async, [&] { return sut.run(there, in(kPatience)); });
  const BatchReply mine = run(here);
  const auto theirs = reply.get();

  ASSERT_TRUE(theirs) << theirs.error().message;
  EXPECT_EQ(fingerprints(mine), fingerprints(run(here)));
  EXPECT_EQ(fingerprints(*theirs), fingerprints(run(there)));
}

TEST_P(EnginePoolContract, ManySubmittedBatchesReplyOnceEach) {
  constexpr std::size_t kBatches = 40;
  std::mutex mutex;  // guards replies
  std::condition_variable arrived;
  std::vector<std::vector<Hash>> replies(kBatches);
  std::size_t count = 0;
  RolloutBatch batch = push_batch(scene, 1);
  batch.stop_losers = false;
  std::vector<std::unique_ptr<AsyncPool::Ticket>> tickets;
  for (std::uint32_t i = 0; i < kBatches; ++i) {
    batch.first_sample = i;
    auto ticket_result = engines.submit(batch, [&, i](Result<BatchReply> reply_result) {
      const std::lock_guard lock(mutex);
      if (reply_result) replies[i] = fingerprints(*reply_result);
      ++count;
      arrived.notify_one();
    });
    ASSERT_TRUE(ticket_result) << ticket_result.error().message;
    tickets.push_back(std::move(ticket_result).value());
  }
  {
    std::unique_lock lock(mutex);
    ASSERT_TRUE(arrived.wait_until(lock, in(kPatience), [&] { return count == kBatches; }));
  }
  for (const auto& ticket : tickets) EXPECT_EQ(ticket->missing(), 0u);
  tickets.clear();

  EXPECT_EQ(count, kBatches);
  batch.first_sample = 0;
  batch.samples = kBatches;
  std::vector<Hash> together = fingerprints(reference(batch)), apart;
  for (const auto& reply : replies) apart.insert(apart.end(), reply.begin(), reply.end());
  EXPECT_EQ(apart, together);
}

TEST_P(EnginePoolContract, TicketThatGoesCancelsItsBatch) {
  std::atomic<int> calls = 0;
  auto ticket_result = engines.submit(wait_batch(scene, 8, 10s), [&](Result<BatchReply>) { ++calls; });
  ASSERT_TRUE(ticket_result);
  EXPECT_EQ((*ticket_result)->missing(), 8u);

  const auto start = Clock::now();
  ticket_result->reset();
  run(wait_batch(scene, 4, 1ms));

  EXPECT_LT(Clock::now() - start, 2s);
  EXPECT_EQ(calls, 0);
}

const auto kName = [](const auto& test) { return std::string(test.param.name); };
const auto kThreads = ::testing::Values(Implementation{"one_thread", 1, 0}, Implementation{"two_threads", 2, 0});
const auto kOneWorker = ::testing::Values(Implementation{"one_worker", 0, 1});
const auto kTwoWorkers = ::testing::Values(Implementation{"two_workers", 0, 2});

INSTANTIATE_TEST_SUITE_P(Threads, PoolContract, kThreads, kName);
INSTANTIATE_TEST_SUITE_P(Threads, EnginePoolContract, kThreads, kName);
INSTANTIATE_TEST_SUITE_P(OneWorker, PoolContract, kOneWorker, kName);
INSTANTIATE_TEST_SUITE_P(OneWorker, EnginePoolContract, kOneWorker, kName);
INSTANTIATE_TEST_SUITE_P(TwoWorkers, PoolContract, kTwoWorkers, kName);
INSTANTIATE_TEST_SUITE_P(TwoWorkers, EnginePoolContract, kTwoWorkers, kName);
const auto kArmOnThreads = ::testing::Values(Implementation{"arm_two_threads", 2, 0, false, &kArm});
const auto kArmOnWorkers = ::testing::Values(Implementation{"arm_two_workers", 0, 2, false, &kArm});
INSTANTIATE_TEST_SUITE_P(ArmOnThreads, PoolContract, kArmOnThreads, kName);
INSTANTIATE_TEST_SUITE_P(ArmOnThreads, EnginePoolContract, kArmOnThreads, kName);
INSTANTIATE_TEST_SUITE_P(ArmOnWorkers, PoolContract, kArmOnWorkers, kName);
INSTANTIATE_TEST_SUITE_P(ArmOnWorkers, EnginePoolContract, kArmOnWorkers, kName);
INSTANTIATE_TEST_SUITE_P(PararealOnThreads, PoolContract,
                         ::testing::Values(Implementation{"parareal_two_threads", 2, 0, true, &kPusher}), kName);
INSTANTIATE_TEST_SUITE_P(PararealOnWorkers, PoolContract,
                         ::testing::Values(Implementation{"parareal_two_workers", 0, 2, true, &kPusher}), kName);

}  // namespace
}  // namespace jostle::tests
