// The hot loop must not allocate: neither ours nor the engine's.

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "physics_pool/coarse/quasi_static_clutter.hpp"
#include "physics_pool/local/engine.hpp"
#include "physics_pool/local/reduced_simulator.hpp"
#include "physics_pool/local/simulator.hpp"
#include "tests/support/costs.hpp"
#include "tests/support/scenes.hpp"

namespace {

std::atomic<long> allocations{0};

void* counted(std::size_t size) {
  ++allocations;
  if (void* memory = std::aligned_alloc(64, (size + 63) / 64 * 64)) return memory;
  throw std::bad_alloc();
}

}  // namespace

void* operator new(std::size_t size) { return counted(size); }
void* operator new[](std::size_t size) { return counted(size); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t) noexcept { std::free(memory); }

namespace jostle::physics_pool {
namespace {

using namespace tests;

void* counted_by_engine(std::size_t size) { return counted(size); }

class AllocationTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    mju_user_malloc = counted_by_engine;
    mju_user_free = std::free;
  }
  static void TearDownTestSuite() {
    mju_user_malloc = nullptr;
    mju_user_free = nullptr;
  }
};

TEST_F(AllocationTest, CounterSeesBothKinds) {
  long before = allocations;
  delete new int(3);
  EXPECT_EQ(allocations, before + 1);
  before = allocations;
  mju_free(mju_malloc(100));
  EXPECT_EQ(allocations, before + 1);
}

TEST_F(AllocationTest, AdvanceAllocatesNothingAfterConstruction) {
  Scene scene = tests::three_objects();
  scene.robot.q[0] = -0.15;
  const WorldPtr world = std::move(World::compile(scene)).value();
  Simulator sut(world);
  const State start = initial_state(scene);
  State x = start;
  const std::array<double, 4> u{0.1, 0.05, 0.2, -0.01};
  const long before = allocations;
  for (int i = 0; i < 10; ++i) (void)sut.advance(x, u, 100);
  EXPECT_EQ(allocations, before);
  EXPECT_NE(x, start);
}

TEST_F(AllocationTest, CoarseAdvanceAllocatesNothingAfterConstruction) {
  Scene scene = tests::three_objects();
  scene.robot.q[0] = -0.15;
  QuasiStaticClutter sut = std::move(QuasiStaticClutter::make(scene)).value();
  const State start = initial_state(scene);
  State x = start;
  const std::array<double, 4> u{0.1, 0.05, 0.2, -0.01};
  const long before = allocations;
  for (int i = 0; i < 10; ++i) sut.advance(x, u, 0.2);
  EXPECT_EQ(allocations, before);
  EXPECT_NE(x.q[5], start.q[5]);  // the target was pushed
}

TEST_F(AllocationTest, AdvanceWithFrozenObjectsAllocatesNothingOnceItsModelsExist) {
  Scene scene = tests::three_objects();
  scene.robot.q[0] = -0.15;
  const WorldPtr world = std::move(World::compile(scene)).value();
  ReducedSimulator sut(world, {.freeze = true});
  const std::array<double, 4> u{0.1, 0.0, 0.2, 0.0};
  std::uint32_t thawed = 0;
  long before = 0;
  for (int repeat = 0; repeat < 2; ++repeat) {
    State x = initial_state(scene);
    thawed = 0;
    before = allocations;
    for (int i = 0; i < 10; ++i) thawed += sut.advance(x, u, 100).thawed;
  }
  EXPECT_EQ(allocations, before);
  EXPECT_GT(thawed, 0u);
}

TEST_F(AllocationTest, AdvanceAllocatesNothingWithAnInterruptOfTwoPointers) {
  const Scene scene = tests::target_only();
  const WorldPtr world = std::move(World::compile(scene)).value();
  Simulator sut(world);
  State x = initial_state(scene);
  const std::array<double, 4> u{};
  int asked = 0, more = 0;
  const long before = allocations;
  (void)sut.advance(x, u, 100, [&asked, &more] { return ++asked + more < 0; });
  EXPECT_EQ(allocations, before);
  EXPECT_EQ(asked, 100);
}

TEST_F(AllocationTest, ScoringAStepAllocatesNothing) {
  const Scene scene = tests::three_objects();
  const TaskGeometry geometry(scene);
  const State a = initial_state(scene);
  State b = a;
  b.q[6] += 0.3;
  const std::array<double, 4> u{0.1, 0, 0, 0}, none{};
  const Objective objective = Objective::standard();
  const Scorer sut(objective);
  const long before = allocations;
  const double cost = sut.running({.geometry = geometry, .u_before = none, .u = u, .x0 = a, .x1 = b}) +
                      sut.final(geometry, b) + sut.at_goal(geometry, b);
  EXPECT_EQ(allocations, before);
  EXPECT_GT(cost, 0.0);
}

}  // namespace
}  // namespace jostle::physics_pool
