#include "physics_pool/objective/bound.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "physics_pool/local/rollout.hpp"
#include "physics_pool/local/simulator.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "tests/support/costs.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

const std::vector<double> kNone{0, 0, 0, 0};

ControlSequence constant(const std::vector<double>& u, int steps) {
  ControlSequence controls{.nu = kGripperControls};
  for (int t = 0; t < steps; ++t) controls.append(u);
  return controls;
}

class OutlookTest : public testing::Test {
 protected:
  Outlook of(const ControlSequence& controls, int done = 0) const {
    const auto before = done == 0 ? std::span<const double>(kNone) : controls.step(done - 1);
    return outlook(geometry, objective, controls, done, before, x, 1.0);
  }

  const Scene scene = tests::target_only();
  const TaskGeometry geometry{scene};
  State x = initial_state(scene);  // the target 0.33 m ahead
  Objective objective = Objective::standard();
};

TEST_F(OutlookTest, StandingStillPaysForTheWholeDistance) {
  const Outlook sut = of(constant(kNone, 3));
  EXPECT_NEAR(sut.cost, objective.weight("goal") * 0.325 * 0.325, 1e-9);  // 5 mm of slack
  EXPECT_FALSE(sut.may_succeed);
}

TEST_F(OutlookTest, TwoMetresPerMetreOfTheHandAtMost) {
  const Outlook sut = of(constant({0.03, 0.04, 0.0, 0.0}, 2));
  const double changes = objective.weight("acceleration") * 0.05 * 0.05;
  EXPECT_NEAR(sut.cost, changes + objective.weight("goal") * std::pow(0.325 - 2 * 0.05 * 2, 2), 1e-9);
}

TEST_F(OutlookTest, NothingIsCertainOfAHandThatCanArrive) {
  const Outlook sut = of(constant({0.1, 0.0, 0.0, 0.0}, 6), 1);
  EXPECT_EQ(sut.cost, 0.0);
  EXPECT_TRUE(sut.may_succeed);
}

TEST_F(OutlookTest, WhatHasDroppedIsPaidForInEveryStepToCome) {
  x.q[static_cast<std::size_t>(geometry.layout.objects[0].q) + 2] = -0.3;
  const Outlook sut = of(constant({0.15, 0.0, 0.0, 0.0}, 6), 2);
  EXPECT_GE(sut.cost, 4 * objective.weight("drop"));
}

// Against physics: no rollout, whatever it pushes, beats what was foretold of it.
TEST(OutlookOfRollouts, IsNeverTooHigh) {
  int judged = 0, hopeless = 0;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const WorldPtr world =
        std::move(World::compile(std::move(generate_chapter3({.objects = 8, .seed = seed})).value())).value();
    const TaskGeometry& geometry = world->geometry();
    Simulator simulator(world);
    RolloutBatch batch;
    batch.x0 = initial_state(world->scene());
    const double speed = seed % 2 == 0 ? 0.07 : 0.025;  // some arrive, some cannot
    for (int t = 0; t < 4; ++t) batch.nominal.append(std::vector{speed, 0.0, 0.0, 0.0});
    batch.u_before = kNone;
    batch.law = {.sigma = {0.04, 0.04, 0.25, 0.004},
                 .limit = {0.15, 0.15, 0.8, 0.05},
                 .scales = {0.125, 0.25, 0.5, 1.0},
                 .seed = seed};
    batch.stop_losers = false;
    batch.want_all_trajectories = true;
    for (std::uint32_t sample = 0; sample < 8; ++sample) {
      BatchSignals signals;
      const RolloutOutcome outcome = run_rollout(simulator, batch, sample, signals);
      ASSERT_EQ(outcome.end, End::kCompleted);
      const ControlSequence controls = sample_controls(batch.nominal, batch.law, sample);
      double paid = 0.0;
      for (int done = 0; done < controls.steps(); ++done) {
        const auto at = static_cast<std::size_t>(done);
        const auto before =
            done == 0 ? std::span<const double>(batch.u_before) : std::as_const(controls).step(done - 1);
        const Outlook sut = outlook(geometry, batch.objective, controls, done, before, outcome.trajectory[at], 1.0);
        EXPECT_LE(paid + sut.cost, outcome.cost * (1 + 1e-12)) << "seed " << seed << " sample " << sample;
        for (std::size_t t = at + 1; t < outcome.trajectory.size() && !sut.may_succeed; ++t) {
          EXPECT_FALSE(at_goal(geometry, outcome.trajectory[t], batch.objective));
        }
        ++judged;
        hopeless += sut.may_succeed ? 0 : 1;
        paid += outcome.step_costs[at];
      }
    }
  }
  EXPECT_EQ(judged, 6 * 8 * 4);
  EXPECT_GT(hopeless, judged / 10);
}

}  // namespace
}  // namespace jostle::physics_pool
