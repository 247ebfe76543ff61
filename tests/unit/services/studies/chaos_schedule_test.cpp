#include "services/studies/bench/chaos_schedule.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>

namespace jostle::studies {
namespace {

using std::chrono::milliseconds;

constexpr int kWorkers = 4, kHosts = 2;

TEST(ChaosSchedule, IsAFunctionOfItsSeed) {
  EXPECT_EQ(chaos_schedule(7, 200, kWorkers, kHosts), chaos_schedule(7, 200, kWorkers, kHosts));
  EXPECT_NE(chaos_schedule(7, 200, kWorkers, kHosts), chaos_schedule(8, 200, kWorkers, kHosts));
}

TEST(ChaosSchedule, HasAsManyFaultsAsAskedInOrder) {
  const auto sut = chaos_schedule(1, 200, kWorkers, kHosts);

  EXPECT_EQ(sut.size(), 200u);
  EXPECT_TRUE(std::ranges::is_sorted(sut, {}, &Fault::at));
}

TEST(ChaosSchedule, HitsEveryWorkerAndHostInEveryWay) {
  std::set<std::pair<Fault::Kind, int>> hit;
  for (const Fault& fault : chaos_schedule(1, 200, kWorkers, kHosts)) hit.insert({fault.kind, fault.target});

  EXPECT_EQ(hit.size(), 2u * kWorkers + kHosts);
}

TEST(ChaosSchedule, HitsNobodyBeforeTheLastFaultWasMadeGood) {
  std::map<std::pair<bool, int>, milliseconds> well;  // of hosts, of workers
  for (const Fault& fault : chaos_schedule(1, 1000, kWorkers, kHosts)) {
    milliseconds& since = well[{fault.kind == Fault::Kind::kUnplug, fault.target}];
    EXPECT_GE(fault.at, since);
    since = fault.at + fault.lasts;
  }
}

TEST(ChaosSchedule, LeavesCablesAloneWithoutHosts) {
  for (const Fault& fault : chaos_schedule(1, 200, kWorkers, 0)) EXPECT_NE(fault.kind, Fault::Kind::kUnplug);
}

}  // namespace
}  // namespace jostle::studies
