// Fleets that nobody has, on a clock that is simulated.

#include "services/studies/bench/fleet.hpp"

#include <gtest/gtest.h>

namespace jostle::tests {
namespace {

using namespace studies;

FleetOptions fleet(int hosts, int lanes) {
  return {.hosts = hosts, .lanes = lanes, .samples_per_lane = 40, .deaths_per_minute = 0.0, .time_scheduler = false};
}

TEST(Fleet, RepeatsToTheLastBit) {
  FleetOptions options = fleet(4, 16);
  options.deaths_per_minute = 30.0;
  options.away = 0.5;

  const FleetResult a = simulate(options), b = simulate(options);

  EXPECT_EQ(a.seconds, b.seconds);
  EXPECT_EQ(a.duplicates, b.duplicates);
  EXPECT_EQ(a.deaths, b.deaths);
}

TEST(Fleet, OneLaneIsHardlyEverIdle) {
  const FleetResult result = simulate(fleet(1, 1));
  EXPECT_TRUE(result.finished);
  EXPECT_GT(result.efficiency, 0.99);
  EXPECT_LE(result.efficiency, 1.0);
  EXPECT_EQ(result.duplicates, 0u);
}

TEST(Fleet, ThousandLanesWithCoresOfTheirOwnAreBusy) {
  const FleetResult result = simulate(fleet(16, 64));
  EXPECT_GT(result.efficiency, 0.95);
  EXPECT_EQ(result.reissued, 0u);
  EXPECT_GT(result.samples_per_answer, 5.0);
}

TEST(Fleet, MessagesThatCostMoreThanTheClientHasHoldAllBack) {
  FleetOptions options = fleet(16, 64);
  options.costs.result = 1.0 / (options.hosts * options.lanes / options.sample) * 2.0;  // twice what it has

  const FleetResult result = simulate(options);

  EXPECT_TRUE(result.finished);
  EXPECT_LT(result.efficiency, 0.55);
  EXPECT_GT(result.client_busy, 0.9);
}

TEST(Fleet, LosesNothingWhereHostsDie) {
  FleetOptions options = fleet(8, 8);
  options.deaths_per_minute = 20.0;  // two or three a second
  options.away = 0.5;

  const FleetResult result = simulate(options);

  EXPECT_TRUE(result.finished);
  EXPECT_GT(result.deaths, 2);
  EXPECT_GT(result.reissued, 0u);
}

// Hundreds of processes of one lane on two cores that cannot keep up: they are late, and nobody is taken for dead.
TEST(Fleet, CrowdOnTooFewCoresIsSlowAndDoesNotRepeatItsWork) {
  FleetOptions options = fleet(256, 1);
  options.shared_cores = 2;
  options.costs.sample = 400e-6;

  const FleetResult result = simulate(options);

  EXPECT_TRUE(result.finished);
  EXPECT_GT(result.efficiency, 0.5);
  EXPECT_LT(static_cast<double>(result.reissued), 0.02 * 256 * options.samples_per_lane);
}

}  // namespace
}  // namespace jostle::tests
