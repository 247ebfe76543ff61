// The terms of Eq. 6.10 and the predicates of Sec. 6.2 and 7.1.

#include <gmock/gmock.h>

#include <cmath>
#include <numbers>

#include "physics_pool/objective/bound.hpp"
#include "physics_pool/objective/terms.hpp"
#include "physics_pool/sampling/counter_rng.hpp"
#include "tests/support/costs.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;

class PushTerms : public testing::Test {
 protected:
  double* object(State& x, int i) { return &x.q[static_cast<std::size_t>(geometry.layout.objects[std::size_t(i)].q)]; }

  void place(State& x, int i, double px, double py) {
    object(x, i)[0] = px;
    object(x, i)[1] = py;
  }

  const Scene scene = tests::push_around();  // target, other; goal at (0.2, 0), obstacle at the origin
  const TaskGeometry geometry{scene};
  const Objective objective = Objective::standard();
  State start = initial_state(scene);
};

TEST_F(PushTerms, GoalCostIsTheSquaredDistanceFromTheRegionsCentre) {
  place(start, 0, 0.2 - 0.3, 0.4);  // 3-4-5
  EXPECT_NEAR(tests::goal_distance(geometry, start), 0.5, 1e-15);
  EXPECT_NEAR(tests::goal_cost(geometry, start, 1.0), 0.25, 1e-15);
  EXPECT_NEAR(tests::final_cost(geometry, objective, start), objective.weight("goal") * 0.25, 1e-9);
  start.q[kJointX] += 0.1;  // where the pusher is does not matter
  EXPECT_NEAR(tests::goal_cost(geometry, start, 1.0), 0.25, 1e-15);
}

TEST_F(PushTerms, ThereIsNoHandToObstruct) { EXPECT_EQ(count_obstructions(geometry, start), 0); }

TEST_F(PushTerms, ObstacleCostFallsWithTheSquaredDistances) {
  const Objective weights = objective_with({{"obstacle_target", 3}, {"obstacle_pusher", 5}});
  place(start, 0, 0.3, 0.4);
  start.q[kJointX] = 0.0;
  start.q[kJointY] = -0.1;
  EXPECT_NEAR(tests::obstacle_cost(geometry, start, weights), 3 / 0.25 + 5 / 0.01, 1e-9);
  place(start, 1, 0.0, 0.0);  // other objects may be there
  EXPECT_NEAR(tests::obstacle_cost(geometry, start, weights), 3 / 0.25 + 5 / 0.01, 1e-9);
}

TEST_F(PushTerms, ObstacleCostIsCapped) {
  const Objective weights = objective_with({{"obstacle_target", 3}, {"obstacle_pusher", 5}, {"obstacle_nearest", 0.1}});
  place(start, 0, 0.0, 0.0);
  start.q[kJointX] = start.q[kJointY] = 0.0;
  EXPECT_NEAR(tests::obstacle_cost(geometry, start, weights), (3 + 5) / 0.01, 1e-9);
}

TEST_F(PushTerms, MissIsHowFarOutsideTheGoalRegionSquared) {
  place(start, 0, 0.2 - 0.3, 0.4);  // 0.5 m from the middle of a region of 4 cm
  EXPECT_NEAR(miss_cost(geometry, start), 0.46 * 0.46, 1e-15);
  place(start, 0, 0.2, 0.039);
  EXPECT_EQ(miss_cost(geometry, start), 0.0);
  EXPECT_EQ(miss_cost(TaskGeometry(tests::target_only()), initial_state(tests::target_only())), 0.0);
}

// The table is 1 m x 0.8 m, and the sliders' radius 51.15 mm.
TEST_F(PushTerms, RimCostGrowsWithTheWayOfWhatIsMovedNearTheBorder) {
  const RimCost rim{.rate = 20.0, .exponent_max = 5.0, .margin = 0.01, .still = 0.001};
  const double safe = 0.4 - 0.05115 - 0.01;
  State end = start;
  place(start, 0, 0.0, safe - 0.1);
  place(end, 0, 0.0, safe - 1e-6);
  EXPECT_EQ(rim_cost(geometry, start, end, rim), 0.0);
  place(end, 0, 0.0, safe + 1e-6);
  EXPECT_NEAR(rim_cost(geometry, start, end, rim), std::exp(20 * 0.1), 1e-3);
  place(start, 0, 0.0, safe + 1e-6 - 0.4);
  EXPECT_NEAR(rim_cost(geometry, start, end, rim), std::exp(5.0), 1e-9);  // capped
  place(start, 0, 0.0, safe + 1e-6 - 0.0009);                             // it stood there before
  EXPECT_EQ(rim_cost(geometry, start, end, rim), 0.0);
  place(end, 1, -0.45, 0.25);  // others count as well
  EXPECT_GT(rim_cost(geometry, start, end, rim), 1.0);
}

TEST_F(PushTerms, EveryActionCostsItsWeight) {
  const std::vector<double> u{0.1, 0.0};
  const double without = running_cost(geometry, objective, u, u, start, start);
  EXPECT_EQ(running_cost(geometry, objective_with({{"action", 7}}), u, u, start, start), without + 7.0);
}

TEST_F(PushTerms, NoObstacleCostsNothing) {
  const TaskGeometry free(tests::push_ahead());
  const State x = initial_state(tests::push_ahead());
  EXPECT_EQ(tests::obstacle_cost(free, x, objective), 0.0);
  EXPECT_FALSE(target_hits_obstacle(free, x));
  EXPECT_FALSE(pusher_hits_obstacle(free, x));
}

TEST_F(PushTerms, TargetHitsTheObstacleWhereFootprintsMeet) {
  constexpr double kTouch = 0.05115 + 0.04;
  for (const double angle : {0.0, 1.0, 2.5, -2.0}) {
    place(start, 0, (kTouch + 1e-9) * std::cos(angle), (kTouch + 1e-9) * std::sin(angle));
    EXPECT_FALSE(target_hits_obstacle(geometry, start));
    place(start, 0, (kTouch - 1e-9) * std::cos(angle), (kTouch - 1e-9) * std::sin(angle));
    EXPECT_TRUE(target_hits_obstacle(geometry, start));
  }
}

// A box 0.1 x 0.2 whose long side, turned by 90 degrees, reaches the obstacle.
TEST_F(PushTerms, TargetHitsTheObstacleAsItIsTurned) {
  Scene boxes = tests::push_around();
  boxes.objects[0] = {.name = "target",
                      .shape = Shape::kBox,
                      .size = {0.1, 0.2, 0.02},
                      .mass = 0.5,
                      .friction = 0.8,
                      .x = -0.12,
                      .y = 0.0};
  const TaskGeometry turned(boxes);
  State x = initial_state(boxes);
  EXPECT_FALSE(target_hits_obstacle(turned, x));
  boxes.objects[0].yaw = std::numbers::pi / 2;
  x = initial_state(boxes);
  EXPECT_TRUE(target_hits_obstacle(turned, x));
}

TEST_F(PushTerms, PusherHitsTheObstacleWhereDiscsMeet) {
  constexpr double kTouch = 0.0145 + 0.04;
  start.q[kJointX] = 0.0;
  start.q[kJointY] = kTouch + 1e-9;
  EXPECT_FALSE(pusher_hits_obstacle(geometry, start));
  start.q[kJointY] = kTouch - 1e-9;
  EXPECT_TRUE(pusher_hits_obstacle(geometry, start));
}

TEST_F(PushTerms, CollisionsCountTargetAndPusher) {
  EXPECT_EQ(count_collisions(geometry, start), 0);
  place(start, 0, 0.05, 0.0);
  EXPECT_EQ(count_collisions(geometry, start), 1);
  start.q[kJointX] = -0.02;
  EXPECT_EQ(count_collisions(geometry, start), 2);
  const Objective weights = objective_with(
      {{"acceleration", 0}, {"disturbance", 0}, {"obstacle_target", 0}, {"obstacle_pusher", 0}, {"collision", 7}});
  const std::vector<double> u{0, 0};
  EXPECT_EQ(tests::running_cost(geometry, weights, u, u, start, start), 14.0);
}

TEST_F(PushTerms, IntrudersAreOthersWhoseCentreIsInTheGoalRegion) {
  place(start, 0, 0.2, 0.0);  // the target is none
  EXPECT_EQ(count_intruders(geometry, start), 0);
  place(start, 1, 0.2 + 0.04 + 1e-9, 0.0);
  EXPECT_EQ(count_intruders(geometry, start), 0);
  place(start, 1, 0.2 + 0.04 - 1e-9, 0.0);
  EXPECT_EQ(count_intruders(geometry, start), 1);
  EXPECT_THAT(intruders(geometry, start), testing::ElementsAre(1));
}

TEST_F(PushTerms, AtGoalIsTheTargetsCentreInsideTheRegion) {
  place(start, 0, 0.2, 0.04 + 1e-9);
  EXPECT_FALSE(at_goal(geometry, start, objective));
  place(start, 0, 0.2, 0.04 - 1e-9);
  EXPECT_TRUE(at_goal(geometry, start, objective));
  object(start, 0)[2] -= objective.value("drop", "height") + 1e-6;
  EXPECT_FALSE(at_goal(geometry, start, objective));
}

TEST_F(PushTerms, RunningCostIsTheWeightedSum) {
  const Objective weights = objective_with({{"acceleration", 3},
                                            {"disturbance", 5},
                                            {"edge", 7},
                                            {"edge_margin", 0.05},
                                            {"drop", 13},
                                            {"obstacle_target", 17},
                                            {"obstacle_pusher", 19},
                                            {"intrusion", 23}});
  State after = start;
  place(after, 0, 0.0, 0.2);
  place(after, 1, 0.2, 0.0);  // from (0, 0.25)
  object(after, 0)[2] -= 0.03;
  after.q[kJointX] = -0.1;
  after.q[kJointY] = 0.0;
  const std::vector<double> u_before{0, 0}, u{0.1, 0.2};
  EXPECT_NEAR(tests::running_cost(geometry, weights, u_before, u, start, after),
              3 * 0.05 + 5 * (0.2 * 0.2 + 0.25 * 0.25) + 13 + 17 / 0.04 + 19 / 0.01 + 23, 1e-9);
}

TEST_F(PushTerms, AreNeverNegativeOrInfiniteForRandomStates) {
  CounterStream random(17, 1);
  for (int i = 0; i < 2000; ++i) {
    State a = start, b = start;
    for (State* x : {&a, &b}) {
      for (int j = 0; j < 2; ++j) x->q[std::size_t(j)] = random.normal(0, 0.1);
      for (int k = 0; k < 2; ++k) {
        for (int j = 0; j < 3; ++j) object(*x, k)[j] = random.normal(0, 0.1);
      }
    }
    const std::vector<double> u0{random.normal(0, 1), random.normal(0, 1)},
        u1{random.normal(0, 1), random.normal(0, 1)};
    for (const double cost :
         {tests::running_cost(geometry, objective, u0, u1, a, b), tests::final_cost(geometry, objective, b),
          tests::obstacle_cost(geometry, b, objective)}) {
      ASSERT_GE(cost, 0.0);
      ASSERT_TRUE(std::isfinite(cost));
    }
  }
}

// Whatever the controls: only changes of control, and what has dropped, are certain.
TEST_F(PushTerms, OutlookForetellsNothingOfThePush) {
  ControlSequence controls{.nu = kPusherControls, .values = {0.0, 0.0, 0.03, 0.04}};
  const std::vector<double> u_before{0.0, 0.0};
  const Outlook far = outlook(geometry, objective, controls, 0, u_before, start, 1.0);
  EXPECT_TRUE(far.may_succeed);
  EXPECT_NEAR(far.cost, objective.weight("acceleration") * 0.0025, 1e-12);
  object(start, 0)[2] = -0.3;
  EXPECT_NEAR(outlook(geometry, objective, controls, 0, u_before, start, 1.0).cost,
              objective.weight("acceleration") * 0.0025 + 2 * objective.weight("drop"), 1e-9);
}

}  // namespace
}  // namespace jostle::physics_pool
