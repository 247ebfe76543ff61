// A coarse model is asked in the inner loop of a planner: it must not allocate.

#include <gtest/gtest.h>

#include <atomic>
#include <cstdlib>
#include <new>

#include "physics_pool/coarse/learned/learned_model.hpp"
#include "tests/support/networks.hpp"

namespace {

std::atomic<long> allocations{0};

void* counted(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
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

TEST(AnalyticModelAllocation, NoneAfterConstruction) {
  const Scene scene = tests::slider_scene(4);
  for (const char* name : {"kinematic", "limit-surface", "planar"}) {
    const auto sut = std::move(make_coarse_model(name, scene)).value();
    std::vector<double> states(static_cast<std::size_t>(sut->layout().size())), controls{0.05, 0.01};
    for (int i = 0; i < 4; ++i)
      states[static_cast<std::size_t>(sut->layout().pose(i))] = 0.08 + 0.1 * i;  // overlapping
    const long before = allocations;
    sut->advance(states, controls, 1.0);
    EXPECT_EQ(allocations - before, 0) << name;
  }
}

TEST(LearnedModelAllocation, NoneAfterConstructionForAnyBatch) {
  const auto sut = std::move(make_learned_model(tests::random_network(512), tests::slider_scene(4), "test")).value();
  const std::size_t size = static_cast<std::size_t>(sut->layout().size());
  for (const std::size_t count : {std::size_t{1}, std::size_t{20}, std::size_t{CoarseModel::kMaxBatch}}) {
    std::vector<double> states(count * size), controls(2 * count, 0.05);
    for (std::size_t k = 0; k < count; ++k) {
      for (int i = 0; i < 4; ++i) states[k * size + static_cast<std::size_t>(sut->layout().pose(i))] = 0.08 + 0.11 * i;
    }
    const std::vector<double> start = states;
    const long before = allocations;
    sut->advance(states, controls, 1.0);
    EXPECT_EQ(allocations, before) << count;
    EXPECT_NE(states, start);
  }
}

}  // namespace
}  // namespace jostle::physics_pool
