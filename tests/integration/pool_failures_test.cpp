// Workers that die, stall or come late.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <deque>
#include <future>

#include "physics_pool/local/thread_pool.hpp"
#include "services/pool/client/remote_pool.hpp"
#include "tests/support/batches.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace physics_pool;
using pool::RemotePool;
using ::testing::HasSubstr;

constexpr auto kPatience = 60s;

// What a pool says of the worker with this process id, in which its name ends.
std::optional<WorkerStatus> status_of(const Pool& pool, pid_t pid) {
  for (const WorkerStatus& status : pool.status().workers) {
    if (status.name.ends_with(fmt::format("-{}", pid))) return status;
  }
  return {};
}

class PoolFailures : public ::testing::Test {
 protected:
  PoolFailures() { EXPECT_TRUE(sut.load(scene)); }

  WorkerProcess& start_worker() { return workers.emplace_back(domain); }

  void start_workers(int count) {
    for (int i = 0; i < count; ++i) start_worker();
    ASSERT_TRUE(sut.wait_for_workers(count, in(kPatience)));
  }

  std::future<Result<BatchReply>> run_aside(const RolloutBatch& batch) {
    return std::async(std::launch::async, [this, batch] { return sut.run(batch, in(kPatience)); });
  }

  // Whether a worker has returned `rollouts` by now or soon.
  bool has_run(const WorkerProcess& worker, std::uint64_t rollouts) {
    return eventually(in(kPatience), [&] {
      const auto status = status_of(sut, worker.pid());
      return status && status->rollouts >= rollouts;
    });
  }

  Hash reference_winner(const RolloutBatch& batch) {
    ThreadPool one(1);
    EXPECT_TRUE(one.load(scene));
    return winner_fingerprint(one.run(batch, in(kPatience)).value());
  }

  const int domain = test_domain();
  const Scene scene = small_scene();
  std::deque<WorkerProcess> workers;
  const wire::Participant participant = wire::Participant::open({.domain = domain}).value();
  RemotePool sut{participant};
};

TEST_F(PoolFailures, WinnerIsTheSameWhenAWorkerIsKilledAndReplaced) {
  const RolloutBatch batch = push_batch(scene, 80);
  const Hash wanted = reference_winner(batch);
  start_workers(2);

  auto reply = run_aside(batch);
  ASSERT_TRUE(has_run(workers[0], 2));
  const pid_t victim = workers[0].pid();
  workers[0].end(SIGKILL);
  start_worker();
  const auto reply_result = reply.get();

  ASSERT_TRUE(reply_result) << reply_result.error().message;
  EXPECT_EQ(winner_fingerprint(*reply_result), wanted);
  EXPECT_TRUE(eventually(in(2s), [&] { return !status_of(sut, victim)->alive; }))
      << "the dead worker is still reported alive";
}

TEST_F(PoolFailures, BatchEndsWhenTheOnlyWorkerIsReplaced) {
  start_workers(1);
  auto reply = run_aside(wait_batch(scene, 100, 20ms));  // far from over when a heartbeat tells of the first two
  ASSERT_TRUE(has_run(workers[0], 2));
  workers[0].end(SIGKILL);
  start_worker();

  const auto reply_result = reply.get();

  ASSERT_TRUE(reply_result) << reply_result.error().message;
  EXPECT_GE(sut.status().reissued, 1u);
}

TEST_F(PoolFailures, StalledWorkerLosesNothingAndComesBack) {
  const RolloutBatch batch = push_batch(scene, 40);
  const Hash wanted = reference_winner(batch);
  start_workers(2);

  auto reply = run_aside(batch);
  ASSERT_TRUE(has_run(workers[0], 2));
  workers[0].signal(SIGSTOP);
  const auto reply_result = reply.get();

  ASSERT_TRUE(reply_result) << reply_result.error().message;
  EXPECT_EQ(winner_fingerprint(*reply_result), wanted);
  ASSERT_TRUE(eventually(in(2s), [&] { return !status_of(sut, workers[0].pid())->alive; }));
  workers[0].signal(SIGCONT);
  ASSERT_TRUE(sut.wait_for_workers(2, in(kPatience)));
  const std::uint64_t before = status_of(sut, workers[0].pid())->rollouts;
  ASSERT_TRUE(sut.run(wait_batch(scene, 20, 20ms), in(kPatience)));
  EXPECT_GT(status_of(sut, workers[0].pid())->rollouts, before);
}

TEST_F(PoolFailures, NewWorkerIsUsedInTheMiddleOfABatch) {
  start_workers(1);
  auto reply = run_aside(wait_batch(scene, 150, 20ms));
  ASSERT_TRUE(has_run(workers[0], 1));

  const WorkerProcess& late = start_worker();

  EXPECT_TRUE(has_run(late, 1));
  EXPECT_EQ(reply.wait_for(0s), std::future_status::timeout) << "the batch was over too early";
  EXPECT_TRUE(reply.get());
}

TEST_F(PoolFailures, WithoutWorkersTheErrorSaysHowToStartOne) {
  RemotePool impatient(participant, {.no_worker_timeout = 300ms});
  ASSERT_TRUE(impatient.load(scene));

  const auto reply_result = impatient.run(push_batch(scene, 1), in(kPatience));

  ASSERT_FALSE(reply_result);
  EXPECT_EQ(reply_result.error().code, Code::kUnavailable);
  EXPECT_THAT(reply_result.error().message, HasSubstr(fmt::format("on domain {}", domain)));
  EXPECT_THAT(reply_result.error().message, HasSubstr("jostle worker"));
}

TEST_F(PoolFailures, WorkerEndsCleanlyInTheMiddleOfItsWork) {
  start_workers(2);
  auto reply = run_aside(wait_batch(scene, 10, 300ms));
  ASSERT_TRUE(has_run(workers[0], 1));

  const auto start = Clock::now();
  const int status = workers[0].end(SIGTERM);
  const auto took = Clock::now() - start;

  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << status;
  EXPECT_LT(took, 200ms);
  EXPECT_TRUE(reply.get());
}

}  // namespace
}  // namespace jostle::tests
