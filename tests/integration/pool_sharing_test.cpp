// Several clients on the same workers: who gets how much of them. Samples wait
// instead of simulating, so that counts tell work time on however busy a machine.

#include <gmock/gmock.h>

#include <deque>
#include <future>
#include <map>
#include <numeric>

#include "services/pool/client/remote_pool.hpp"
#include "tests/support/batches.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace physics_pool;
using pool::RemotePool;

constexpr auto kPatience = 60s;

struct Client {
  explicit Client(int domain, const pool::RemotePoolOptions& options = {})
      : participant(wire::Participant::open({.domain = domain}).value()), pool(participant, options) {}

  std::uint64_t rollouts() const {
    const auto workers = pool.status().workers;
    return std::accumulate(workers.begin(), workers.end(), std::uint64_t{0},
                           [](std::uint64_t sum, const WorkerStatus& worker) { return sum + worker.rollouts; });
  }

  const wire::Participant participant;
  RemotePool pool;
};

class PoolSharing : public ::testing::Test {
 protected:
  void start(int worker_count, int client_count) {
    for (int i = 0; i < worker_count; ++i) workers.emplace_back(domain);
    for (int i = 0; i < client_count; ++i) {
      Client& client = clients.emplace_back(domain);
      ASSERT_TRUE(client.pool.load(scene));
      ASSERT_TRUE(client.pool.wait_for_workers(worker_count, in(kPatience)));
    }
  }

  std::future<Result<BatchReply>> run_aside(Client& client, const RolloutBatch& batch, std::stop_token stop = {}) {
    return std::async(std::launch::async,
                      [&client, batch, stop] { return client.pool.run(batch, in(kPatience), stop); });
  }

  // Seconds of work that clients[0 … n-2], which have work without end, were given
  // while clients[n-1] had all of `last` done.
  std::vector<double> served_meanwhile(const std::vector<std::chrono::milliseconds>& lengths,
                                       const RolloutBatch& last) {
    std::stop_source stop;
    std::vector<std::future<Result<BatchReply>>> endless;
    for (std::size_t i = 0; i < lengths.size(); ++i) {
      endless.push_back(run_aside(clients[i], wait_batch(scene, 100'000, lengths[i]), stop.get_token()));
    }
    for (std::size_t i = 0; i < lengths.size(); ++i) {
      EXPECT_TRUE(eventually(in(kPatience), [&] { return clients[i].rollouts() >= 4; }));
    }
    std::vector<std::uint64_t> before;
    for (std::size_t i = 0; i < lengths.size(); ++i) before.push_back(clients[i].rollouts());
    const auto reply_result = clients.back().pool.run(last, in(kPatience));
    EXPECT_TRUE(reply_result) << reply_result.error().message;
    std::vector<double> served;
    for (std::size_t i = 0; i < lengths.size(); ++i) {
      const auto samples = static_cast<double>(clients[i].rollouts() - before[i]);
      served.push_back(samples * std::chrono::duration<double>(lengths[i]).count());
    }
    for (std::size_t i = 0; i < served.size(); ++i)
      RecordProperty("served_" + std::to_string(i), std::to_string(served[i]));
    stop.request_stop();
    for (auto& reply : endless) EXPECT_EQ(reply.get().error().code, Code::kCancelled);
    return served;
  }

  void expect_nothing_was_lost_or_copied() {
    for (const Client& client : clients) {
      EXPECT_EQ(client.pool.status().reissued, 0u);
      EXPECT_EQ(client.pool.status().duplicates, 0u);
    }
  }

  const int domain = test_domain();
  const Scene scene = small_scene();
  std::deque<WorkerProcess> workers;
  std::deque<Client> clients;
};

TEST_F(PoolSharing, SmallBatchGetsAsManySamplesAsTheBigOneMeanwhile) {
  start(2, 2);
  const double served = served_meanwhile({10ms}, wait_batch(scene, 60, 10ms)).front();
  EXPECT_NEAR(0.6 / (served + 0.6), 0.5, 0.1);
}

TEST_F(PoolSharing, ShortSamplesGetAsMuchTimeAsLongOnes) {
  start(2, 2);
  const double served = served_meanwhile({60ms}, wait_batch(scene, 240, 5ms)).front();
  EXPECT_NEAR(1.2 / (served + 1.2), 0.5, 0.12);
}

TEST_F(PoolSharing, SamplesShorterThanAnExchangeGetTheirTimeToo) {
  start(2, 2);
  const double served = served_meanwhile({60ms}, wait_batch(scene, 1000, 500us)).front();
  EXPECT_GE(0.5 / (served + 0.5), 0.25);  // a pause of 0.5 ms takes longer, and is charged so
}

TEST_F(PoolSharing, LongSamplesGetAsMuchTimeAsShortOnes) {
  start(2, 2);
  const double served = served_meanwhile({5ms}, wait_batch(scene, 20, 60ms)).front();
  EXPECT_NEAR(1.2 / (served + 1.2), 0.5, 0.12);
}

TEST_F(PoolSharing, ThreeClientsGetAThirdEach) {
  start(2, 3);
  const auto served = served_meanwhile({30ms, 5ms}, wait_batch(scene, 60, 10ms));
  const double sum = served[0] + served[1] + 0.6;
  EXPECT_NEAR(served[0] / sum, 1.0 / 3, 0.1);
  EXPECT_NEAR(served[1] / sum, 1.0 / 3, 0.1);
}

TEST_F(PoolSharing, UrgentBatchGoesFirstAndTheNormalOneGoesOn) {
  start(2, 2);
  RolloutBatch urgent = wait_batch(scene, 140, 10ms);
  urgent.priority = Priority::kUrgent;
  const double served = served_meanwhile({10ms}, urgent).front();
  EXPECT_GE(served, 0.1) << "starved";
  EXPECT_LE(served / (served + 1.4), 0.2);
}

TEST_F(PoolSharing, BatchThatHasToWaitIsNeitherReissuedNorCopied) {
  start(2, 2);
  RolloutBatch urgent = wait_batch(scene, 100'000, 60ms);
  urgent.priority = Priority::kUrgent;
  std::stop_source stop;
  auto endless = run_aside(clients[1], urgent, stop.get_token());
  ASSERT_TRUE(eventually(in(kPatience), [&] { return clients[1].rollouts() >= 2; }));

  // One sample in 8 turns of 60 ms: each waits longer than it takes to be called lost.
  const auto reply_result = clients[0].pool.run(wait_batch(scene, 6, 60ms), in(kPatience));

  EXPECT_TRUE(reply_result) << reply_result.error().message;
  stop.request_stop();
  EXPECT_EQ(endless.get().error().code, Code::kCancelled);
  expect_nothing_was_lost_or_copied();
}

TEST_F(PoolSharing, EverySampleIsTracedFromSendingToReceiving) {
  start(2, 0);
  std::vector<pool::SampleTrace> traces;  // complete when run() returns
  Client client(domain, {.on_sample = [&](const pool::SampleTrace& trace) { traces.push_back(trace); }});
  ASSERT_TRUE(client.pool.load(scene));
  ASSERT_TRUE(client.pool.wait_for_workers(2, in(kPatience)));

  ASSERT_TRUE(client.pool.run(wait_batch(scene, 20, 5ms), in(kPatience)));

  std::map<std::uint32_t, int> firsts;
  for (const pool::SampleTrace& trace : traces) {
    firsts[trace.sample] += trace.first;
    EXPECT_EQ(trace.client, client.participant.id());
    EXPECT_EQ(trace.thread, 0u);
    // One machine, one clock: everything in its order.
    EXPECT_LE(trace.sent, trace.arrived);
    EXPECT_LE(trace.arrived, trace.started);
    EXPECT_GE(trace.finished - trace.started, 0.005);
    EXPECT_LE(trace.finished, trace.received);
  }
  EXPECT_EQ(firsts.size(), 20u);
  for (const auto& [sample, count] : firsts) EXPECT_EQ(count, 1) << sample;
  const pool::Timeline timeline = pool::timeline_of(traces, client.pool.status().workers);
  EXPECT_EQ(timeline.rows.size(), 2u);
  EXPECT_GT(timeline.efficiency, 0.3);
  EXPECT_LT(timeline.clock_error, 0.05);
}

}  // namespace
}  // namespace jostle::tests
