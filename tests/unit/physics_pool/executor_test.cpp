#include "physics_pool/local/executor.hpp"

#include <gmock/gmock.h>
#include <sched.h>

#include <cstddef>
#include <future>
#include <memory>
#include <system_error>

#include "tests/support/batches.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace physics_pool;

BatchRunPtr waiting_run(std::chrono::nanoseconds time) {
  const auto run = std::make_shared<BatchRun>();
  run->batch = wait_batch(small_scene(), 4, time);
  run->world = World::compile(small_scene()).value();
  return run;
}

TEST(Executor, SaysWhereAndWhenASampleRan) {
  const auto run = waiting_run(3ms);
  std::promise<Shift> told;
  run->on_outcome = [&](const RolloutOutcome&, const Shift& shift) { told.set_value(shift); };
  const auto before = std::chrono::steady_clock::now();
  Executor sut(1);
  sut.submit(run, 0);

  const Shift shift = told.get_future().get();

  EXPECT_EQ(shift.thread, 0);
  EXPECT_GE(shift.started, before);
  EXPECT_GE(shift.finished - shift.started, 3ms);
}

TEST(Executor, ThreadsStayOnTheirCores) {
  cpu_set_t allowed;
  ASSERT_EQ(sched_getaffinity(0, sizeof allowed, &allowed), 0);
  int core = CPU_SETSIZE - 1;  // the last one, which nobody gets by chance
  while (!CPU_ISSET(core, &allowed)) --core;
  const auto run = waiting_run(0ns);
  std::promise<std::pair<int, bool>> told;
  run->on_outcome = [&](const RolloutOutcome&, const Shift&) {
    cpu_set_t mine;
    sched_getaffinity(0, sizeof mine, &mine);
    told.set_value({CPU_COUNT(&mine), CPU_ISSET(core, &mine)});
  };
  Executor sut(1, {core});
  sut.submit(run, 0);

  EXPECT_EQ(told.get_future().get(), std::pair(1, true));
}

// Planning in several worlds in turn must not make simulators all the time.
TEST(Executor, KeepsSimulatorsWithinItsMemory) {
  const auto run_all = [](std::size_t bytes) {
    std::vector<WorldPtr> worlds;
    std::size_t size = 0;
    for (std::uint64_t seed = 1; seed <= 6; ++seed) worlds.push_back(World::compile(small_scene(seed)).value());
    Executor sut(1, {}, bytes);
    for (int round = 0; round < 2; ++round) {
      for (const WorldPtr& world : worlds) {
        const auto run = std::make_shared<BatchRun>();
        run->batch = push_batch(world->scene(), 1);
        run->world = world;
        std::promise<void> done;
        run->on_outcome = [&](const RolloutOutcome&, const Shift&) { done.set_value(); };
        sut.submit(run, 0);
        done.get_future().get();
      }
    }
    for (const WorldPtr& world : worlds) size += world.use_count() > 1 ? 1 : 0;  // some simulator has it still
    return size;
  };
  EXPECT_EQ(run_all(std::size_t{1} << 30), 6u);
  EXPECT_EQ(run_all(1), 1u);
}

TEST(Executor, CoreThatIsNotThereIsAnError) { EXPECT_THROW(Executor(1, {CPU_SETSIZE - 1}), std::system_error); }

}  // namespace
}  // namespace jostle::tests
