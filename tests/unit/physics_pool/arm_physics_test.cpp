// Physical sanity of an arm among the things of a shelf. `jostle bench arm-physics` does more of the same.

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "physics_pool/local/inspection.hpp"
#include "physics_pool/local/simulator.hpp"
#include "physics_pool/robot/kinematics.hpp"
#include "physics_pool/scenarios/chapter4.hpp"
#include "physics_pool/task/task_geometry.hpp"

namespace jostle::physics_pool {
namespace {

class ArmPhysics : public testing::Test {
 protected:
  static inline const Scene scene = generate_chapter4_arm({.seed = 2}).value();
  static inline const WorldPtr world = World::compile(scene).value();
  static constexpr int kStep = 5;  // engine steps between two looks

  Inspection look(const State& x, std::span<const double> u) {
    auto result = inspector.look(x, u);
    if (!result) throw std::runtime_error(result.error().message);
    return std::move(result).value();
  }

  const TaskGeometry& geometry = world->geometry();
  Simulator simulator{world};
  Inspector inspector{world};
  State x = initial_state(scene);
  const std::vector<double> still = std::vector(7, 0.0);
};

TEST_F(ArmPhysics, NothingDriftsIn10SecondsAtRest) {
  const State start = x;
  const double energy = look(x, still).energy;
  for (int t = 0; t < 10; ++t) ASSERT_EQ(simulator.advance(x, still, 500).diverged, "");
  for (std::size_t j = 0; j < scene.robot.q.size(); ++j) EXPECT_NEAR(x.q[j], start.q[j], 1e-5) << "joint " << j;
  for (const ObjectSlot& slot : geometry.layout.objects) {
    const ObjectView before(slot, start), after(slot, x);
    EXPECT_LT(std::hypot(after.position()[0] - before.position()[0], after.position()[1] - before.position()[1]), 1e-4)
        << slot.name;
    EXPECT_LT(angle_between(before.orientation(), after.orientation()), 1e-3) << slot.name;
  }
  EXPECT_LE(look(x, still).energy, energy + 1e-6);
}

// Once the arm has stopped in what it pushed over, all that still moves only slows down.
TEST_F(ArmPhysics, EnergyDoesNotGrowBehindAPush) {
  std::vector<double> u(7, 0.0);
  u[1] = 1.2;  // the shoulder leans forward
  u[2] = -0.8;
  simulator.advance(x, u, 200);
  simulator.advance(x, still, 100);
  double energy = look(x, still).energy;
  for (int i = 0; i < 100; ++i) {
    ASSERT_EQ(simulator.advance(x, still, kStep).diverged, "");
    const double now = look(x, still).energy;
    EXPECT_LE(now, energy + 2e-4) << "J, " << i;  // of springy contacts, which store what they take
    energy = now;
  }
}

// The drives' own force is limited; what carries the arm's weight comes on top of it.
TEST_F(ArmPhysics, TorqueOfTheStandingArmIsWithinTheJointsLimits) {
  const Inspection seen = look(x, still);
  for (std::size_t j = 0; j < 6; ++j) {
    EXPECT_LT(std::abs(seen.drive[j]), scene.robot.model.joints[j].force_limit) << scene.robot.model.joints[j].name;
  }
}

}  // namespace
}  // namespace jostle::physics_pool
