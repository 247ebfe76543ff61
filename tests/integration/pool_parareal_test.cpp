// Parareal over worker processes: the fine model bit for bit, and workers that die.

#include <gmock/gmock.h>

#include <algorithm>
#include <future>

#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/parareal/parareal_pool.hpp"
#include "services/pool/client/remote_pool.hpp"
#include "tests/support/batches.hpp"
#include "tests/support/pushing.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace physics_pool;

constexpr auto kPatience = 60s;

class PararealOverDds : public ::testing::TestWithParam<int> {
 protected:
  static std::vector<Hash> predict(AsyncPool& pool, const Scene& scene, const RolloutBatch& batch, int iterations) {
    PararealPool parareal(pool, {.stop = {.iterations = iterations}});
    EXPECT_TRUE(parareal.load(scene));
    auto reply_result = parareal.run(batch, in(kPatience));
    if (!reply_result) throw std::runtime_error(reply_result.error().message);
    return fingerprints(*reply_result);
  }

  const Scene scene = GetParam() == 1 ? pushing_scene(-0.075, 0.02, {slider_box("box", 0.0, 0.0)}) : four_sliders();
  const int domain = test_domain();
  std::vector<WorkerProcess> workers;
  wire::Participant participant = wire::Participant::open({.domain = domain}).value();
  pool::RemotePool remote{participant};
  ThreadPool thread{1};
};

TEST_P(PararealOverDds, AllIterationsAreTheSerialFineModel) {
  for (int i = 0; i < 2; ++i) workers.emplace_back(domain);
  ASSERT_TRUE(remote.wait_for_workers(2, in(kPatience)));
  const RolloutBatch batch = pushes(scene, {0.05, 0.004}, 4, 0.5, 2, 0.01);
  ASSERT_TRUE(thread.load(scene));

  EXPECT_EQ(predict(remote, scene, batch, 4), fingerprints(thread.run(batch, in(kPatience)).value()));
}

TEST_P(PararealOverDds, WorkerKilledInMidIterationChangesNothing) {
  for (int i = 0; i < 2; ++i) workers.emplace_back(domain);
  ASSERT_TRUE(remote.wait_for_workers(2, in(kPatience)));
  const RolloutBatch batch = pushes(scene, {0.05, 0.004}, 4, 4.0, 4, 0.01);
  const auto wanted = predict(thread, scene, batch, 2);
  PararealPool sut(remote, {.stop = {.iterations = 2}});
  ASSERT_TRUE(sut.load(scene));

  auto reply = std::async(std::launch::async, [&] { return sut.run(batch, in(kPatience)); });
  const auto done = [&] {
    std::uint64_t sum = 0;
    for (const WorkerStatus& worker : remote.status().workers) sum += worker.rollouts;
    return sum;
  };
  ASSERT_TRUE(eventually(in(kPatience), [&] { return done() >= 3; }));
  ASSERT_NE(reply.wait_for(0s), std::future_status::ready) << "the batch should take longer";
  workers.front().end(SIGKILL);

  const auto reply_result = reply.get();
  ASSERT_TRUE(reply_result) << reply_result.error().message;
  EXPECT_EQ(fingerprints(*reply_result), wanted);
  // Second copies may have come back before the death was noticed: nothing has to be sent again then.
  EXPECT_TRUE(eventually(in(2s), [&] {
    return std::ranges::any_of(remote.status().workers, [](const WorkerStatus& worker) { return !worker.alive; });
  })) << "the dead worker is still reported alive";
}

INSTANTIATE_TEST_SUITE_P(Sliders, PararealOverDds, ::testing::Values(1, 4),
                         [](const auto& test) { return std::to_string(test.param); });

}  // namespace
}  // namespace jostle::tests
