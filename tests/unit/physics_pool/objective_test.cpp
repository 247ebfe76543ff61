#include "physics_pool/objective/terms.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

#include "physics_pool/sampling/counter_rng.hpp"
#include "tests/support/costs.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::physics_pool {
namespace {

using namespace tests;
using std::numbers::pi;

class ObjectiveTerms : public testing::Test {
 protected:
  double* object(State& x, int i) { return &x.q[static_cast<std::size_t>(geometry.layout.objects[std::size_t(i)].q)]; }

  void place(State& x, int i, double px, double py) {
    object(x, i)[0] = px;
    object(x, i)[1] = py;
  }

  // Turns object i by `angle` about an axis in the plane (or the vertical).
  void turn(State& x, int i, double angle, double ax, double ay, double az) {
    double* q = object(x, i) + 3;
    q[0] = std::cos(angle / 2);
    q[1] = ax * std::sin(angle / 2);
    q[2] = ay * std::sin(angle / 2);
    q[3] = az * std::sin(angle / 2);
  }

  void place_hand(State& x, double px, double py, double rotation) {
    x.q[kJointX] = px;
    x.q[kJointY] = py;
    x.q[kJointRotation] = rotation;
  }

  // Puts the target at (forward, left) of the hand.
  void place_in_hand(State& x, double forward, double left) {
    const double a = x.q[kJointRotation];
    place(x, 0, x.q[kJointX] + forward * std::cos(a) - left * std::sin(a),
          x.q[kJointY] + forward * std::sin(a) + left * std::cos(a));
  }

  const Scene scene = tests::three_objects();  // target, can, carton
  const TaskGeometry geometry{scene};
  const Objective objective = Objective::standard();
  State start = initial_state(scene);
};

TEST_F(ObjectiveTerms, KnowTheSurfaceAndRestingHeights) {
  EXPECT_EQ(geometry.surface, Surface::table(0.6, 0.6));
  EXPECT_THAT(geometry.rest_heights, testing::ElementsAre(0.019, 0.025, 0.019));
}

// Fig. 3.2: a 3-4-5 triangle ahead of hands that look in many directions.
TEST_F(ObjectiveTerms, GoalDistanceAndAngleFollowTheHand) {
  for (const double rotation : {0.0, 0.7, pi / 2, 3.0, -2.0, 8.5}) {
    place_hand(start, 0.1, -0.05, rotation);
    for (const double side : {-1.0, 1.0}) {
      place_in_hand(start, 0.04, side * 0.03);
      const TargetBearing bearing = target_bearing(geometry, start);
      EXPECT_NEAR(bearing.distance, 0.05, 1e-12);
      EXPECT_NEAR(bearing.angle, std::atan2(0.03, 0.04), 1e-9);
      EXPECT_NEAR(tests::goal_cost(geometry, start, 2.0), 0.05 * 0.05 + 2.0 * std::pow(std::atan2(0.03, 0.04), 2),
                  1e-9);
    }
  }
}

TEST_F(ObjectiveTerms, GoalAngleIsPiBehindTheHandAndZeroAhead) {
  place_hand(start, 0, 0, 1.1);
  place_in_hand(start, -0.1, 0.0);
  EXPECT_NEAR(target_bearing(geometry, start).angle, pi, 1e-9);
  place_in_hand(start, 0.1, 0.0);
  EXPECT_NEAR(target_bearing(geometry, start).angle, 0.0, 1e-9);
  place_in_hand(start, 0.0, -0.1);
  EXPECT_NEAR(target_bearing(geometry, start).angle, pi / 2, 1e-9);
}

TEST_F(ObjectiveTerms, GoalCostDoesNotChangeWhenEverythingMovesTogether) {
  place_hand(start, -0.2, 0.1, 0.3);
  place_in_hand(start, 0.07, 0.02);
  const double before = tests::goal_cost(geometry, start, 1.0);
  place_hand(start, 0.15, -0.12, -1.9);
  place_in_hand(start, 0.07, 0.02);
  EXPECT_NEAR(tests::goal_cost(geometry, start, 1.0), before, 1e-12);
}

TEST_F(ObjectiveTerms, GoalCostOfATargetAtTheOriginOfTheHandIsZero) {
  place_hand(start, 0, 0, 0.4);
  EXPECT_EQ(tests::goal_cost(geometry, start, 1.0), 0.0);
}

TEST_F(ObjectiveTerms, AccelerationIsTheSquaredChangeOfControls) {
  EXPECT_DOUBLE_EQ(acceleration_cost(std::vector<double>{0, 0, 0, 0}, std::vector<double>{1, 2, 3, -4}), 30.0);
  EXPECT_DOUBLE_EQ(acceleration_cost(std::vector<double>{1, 2, 3, 4}, std::vector<double>{1, 2, 3, 4}), 0.0);
}

TEST_F(ObjectiveTerms, DisturbanceSumsSquaredDistancesOfAllButTheTarget) {
  State after = start;
  object(after, 0)[0] += 1.0;   // the target may move
  object(after, 1)[0] += 0.03;  // 3-4-12: 13 cm
  object(after, 1)[1] += 0.04;
  object(after, 1)[2] += 0.12;
  object(after, 2)[1] -= 0.1;
  EXPECT_NEAR(disturbance_cost(geometry, start, after, 0.0), 0.0169 + 0.01, 1e-15);
}

TEST_F(ObjectiveTerms, DisturbanceExcludesWhicheverObjectIsTheTarget) {
  Scene other = scene;
  other.task.target = "can";
  const TaskGeometry second(other);
  State after = start;
  object(after, 1)[0] += 0.5;
  EXPECT_NEAR(disturbance_cost(second, start, after, 1.0), 0.0, 1e-12);
  object(after, 0)[0] += 0.5;
  EXPECT_NEAR(disturbance_cost(second, start, after, 1.0), 0.25, 1e-12);
}

TEST_F(ObjectiveTerms, DisturbanceWeighsRotationsWhenAsked) {
  State after = start;
  turn(start, 1, 0.3, 0, 0, 1);
  turn(after, 1, 0.3 + 0.2, 0, 0, 1);
  EXPECT_EQ(disturbance_cost(geometry, start, after, 0.0), 0.0);
  EXPECT_NEAR(disturbance_cost(geometry, start, after, 5.0), 5.0 * 0.04, 1e-9);
}

TEST_F(ObjectiveTerms, DisturbanceSeesQuaternionsOfEitherSignAsOne) {
  State after = start;
  for (int i = 3; i < 7; ++i) object(after, 2)[i] *= -1;
  EXPECT_NEAR(disturbance_cost(geometry, start, after, 1.0), 0.0, 1e-12);
}

TEST_F(ObjectiveTerms, DisturbanceIgnoresTheRobot) {
  State after = start;
  place_hand(after, 0.2, 0.2, 2.0);
  EXPECT_NEAR(disturbance_cost(geometry, start, after, 1.0), 0.0, 1e-12);
}

TEST_F(ObjectiveTerms, EdgeCostIsZeroInsideTheSafeZoneHoweverFarTheMove) {
  State after = start;
  const double border = 0.3 - objective.value("edge", "margin");
  place(after, 1, border - 1e-9, -border + 1e-9);
  EXPECT_EQ(tests::edge_cost(geometry, start, after, objective), 0.0);
}

TEST_F(ObjectiveTerms, EdgeCostGrowsExponentiallyOutsideTheSafeZone) {
  const Objective gentle = objective_with({{"edge_rate", 20}, {"edge_exponent_max", 100}});
  const double border = 0.3 - gentle.value("edge", "margin");
  const double sides[4][2]{{border + 0.01, 0}, {-border - 0.01, 0}, {0, border + 0.01}, {0, -border - 0.01}};
  for (const auto& side : sides) {
    State before = start, after = start;
    place(after, 1, side[0], side[1]);
    place(before, 1, side[0] - 0.03, side[1] + 0.04);  // 5 cm before
    EXPECT_NEAR(tests::edge_cost(geometry, before, after, gentle), std::exp(20 * 0.05), 1e-9);
    EXPECT_DOUBLE_EQ(tests::edge_cost(geometry, after, after, gentle), 1.0);  // out but still: exp(0)
  }
}

TEST_F(ObjectiveTerms, EdgeCostIsCapped) {
  State after = start;
  place(after, 1, 0.29, 0);
  EXPECT_DOUBLE_EQ(tests::edge_cost(geometry, start, after, objective),
                   std::exp(objective.value("edge", "exponent_max")));
  place(after, 2, 0, 5.0);  // far off the table, and still finite
  EXPECT_DOUBLE_EQ(tests::edge_cost(geometry, start, after, objective),
                   2 * std::exp(objective.value("edge", "exponent_max")));
}

TEST_F(ObjectiveTerms, EdgeCostCountsTheTargetToo) {
  place(start, 0, 0.29, 0);
  EXPECT_DOUBLE_EQ(tests::edge_cost(geometry, start, start, objective), 1.0);
}

TEST_F(ObjectiveTerms, TopplingStartsAtTheAngleInEveryDirection) {
  for (int k = 0; k < 8; ++k) {
    const double ax = std::cos(k * pi / 4), ay = std::sin(k * pi / 4);
    turn(start, 1, 0.499, ax, ay, 0);
    EXPECT_EQ(toppled_objects(geometry, start, 0.5), 0);
    turn(start, 1, 0.501, ax, ay, 0);
    EXPECT_EQ(toppled_objects(geometry, start, 0.5), 1);
  }
}

TEST_F(ObjectiveTerms, TopplingIgnoresYawAndSeesUpsideDown) {
  turn(start, 1, 2.5, 0, 0, 1);
  EXPECT_EQ(toppled_objects(geometry, start, 0.5), 0);
  turn(start, 1, pi, 1, 0, 0);
  turn(start, 2, pi / 2, 0, 1, 0);
  EXPECT_EQ(toppled_objects(geometry, start, 0.5), 2);
}

TEST_F(ObjectiveTerms, DroppingStartsAtTheHeight) {
  object(start, 1)[2] = 0.025 - 0.0199;
  EXPECT_THAT(dropped_objects(geometry, start, 0.02), testing::IsEmpty());
  object(start, 1)[2] = 0.025 - 0.0201;
  EXPECT_THAT(dropped_objects(geometry, start, 0.02), testing::ElementsAre(1));
  EXPECT_EQ(count_dropped(geometry, start, 0.02), 1);
  object(start, 0)[2] = -0.7;
  EXPECT_THAT(dropped_objects(geometry, start, 0.02), testing::ElementsAre(0, 1));
  EXPECT_EQ(count_dropped(geometry, start, 0.02), 2);
}

class Grasped : public ObjectiveTerms {
 protected:
  bool at(double forward, double left, double rotation = 0.0) {
    place_hand(start, 0.03, -0.02, rotation);
    place_in_hand(start, forward, left);
    return at_goal(geometry, start, objective);
  }
  static constexpr double kEps = 1e-9;
  const double kMiddle = (kHand.near + kHand.far) / 2;
};

TEST_F(Grasped, IsInsideTheBordersOfTheRegionOnly) {
  for (const double rotation : {0.0, 1.0, -2.5}) {
    EXPECT_TRUE(at(kMiddle, 0, rotation));
    EXPECT_TRUE(at(kHand.near + kEps, 0, rotation));
    EXPECT_FALSE(at(kHand.near - kEps, 0, rotation));
    EXPECT_TRUE(at(kHand.far - kEps, 0, rotation));
    EXPECT_FALSE(at(kHand.far + kEps, 0, rotation));
    EXPECT_TRUE(at(kMiddle, kHand.side - kEps, rotation));
    EXPECT_FALSE(at(kMiddle, kHand.side + kEps, rotation));
    EXPECT_TRUE(at(kMiddle, -kHand.side + kEps, rotation));
    EXPECT_FALSE(at(kMiddle, -kHand.side - kEps, rotation));
  }
}

TEST_F(Grasped, EndsAtTheFingersWhenTheHandIsNarrow) {
  start.q[kJointLeft] = 0.01;
  start.q[kJointRight] = 0.02;
  EXPECT_TRUE(at(kMiddle, 0.01 - kEps));
  EXPECT_FALSE(at(kMiddle, 0.01 + kEps));
  EXPECT_TRUE(at(kMiddle, -0.02 + kEps));
  EXPECT_FALSE(at(kMiddle, -0.02 - kEps));
}

TEST_F(Grasped, NeedsATargetThatStandsOnTheSurface) {
  ASSERT_TRUE(at(kMiddle, 0));
  turn(start, 0, objective.value("topple", "angle") + 0.01, 1, 0, 0);
  EXPECT_FALSE(at(kMiddle, 0));
  turn(start, 0, 0, 1, 0, 0);
  object(start, 0)[2] -= objective.value("drop", "height") + 1e-6;
  EXPECT_FALSE(at(kMiddle, 0));
}

TEST_F(Grasped, DoesNotCareForOtherObjects) {
  place(start, 0, 1, 1);
  place_hand(start, 0, 0, 0);
  place(start, 1, kMiddle, 0);
  EXPECT_FALSE(at_goal(geometry, start, objective));
}

TEST_F(ObjectiveTerms, ObstructionsAreOtherObjectsBetweenTheFingers) {
  place_hand(start, 0.5, 0.2, 1.0);
  place_in_hand(start, 0.03, 0.0);  // the target is none
  EXPECT_EQ(count_obstructions(geometry, start), 0);
  const auto put = [&](double forward, double left) {
    place(start, 1, 0.5 + std::cos(1.0) * forward - std::sin(1.0) * left,
          0.2 + std::sin(1.0) * forward + std::cos(1.0) * left);
    return count_obstructions(geometry, start);
  };
  constexpr double kEps = 1e-9;
  EXPECT_EQ(put(kHand.finger_length / 2, 0.0), 1);
  EXPECT_EQ(put(kHand.finger_length + kEps, 0.0), 0);
  EXPECT_EQ(put(-kEps, 0.0), 0);
  EXPECT_EQ(put(0.03, start.q[kJointLeft] + kEps), 0);
  EXPECT_EQ(put(0.03, -start.q[kJointRight] - kEps), 0);
  const Objective strict = objective_with({{"obstruction", 7}});
  const double clear = tests::final_cost(geometry, strict, start);
  ASSERT_EQ(put(0.03, 0.0), 1);
  EXPECT_DOUBLE_EQ(tests::final_cost(geometry, strict, start), clear + 7);
}

TEST_F(ObjectiveTerms, RunningCostIsTheWeightedSum) {
  const Objective weights = objective_with({{"acceleration", 3},
                                            {"disturbance", 5},
                                            {"disturbance_rotation", 0},
                                            {"edge", 7},
                                            {"edge_rate", 10},
                                            {"edge_exponent_max", 50},
                                            {"edge_margin", 0.05},
                                            {"topple", 11},
                                            {"topple_angle", 0.5},
                                            {"drop", 13},
                                            {"drop_height", 0.02}});
  State after = start;
  place(after, 1, 0.29, start.q[5 + 7 + 1]);  // from x = 0.05: 24 cm
  turn(after, 2, 1.0, 1, 0, 0);
  object(after, 0)[2] -= 0.03;
  const std::vector<double> u_before{0, 0, 0, 0}, u{0.1, 0, 0, 0.2};
  EXPECT_NEAR(tests::running_cost(geometry, weights, u_before, u, start, after),
              3 * 0.05 + 5 * 0.24 * 0.24 + 7 * std::exp(2.4) + 11 * 1 + 13 * 1, 1e-9);
}

TEST_F(ObjectiveTerms, AreNeverNegativeOrInfiniteForRandomStates) {
  CounterStream random(17, 1);
  for (int i = 0; i < 5000; ++i) {
    State a = start, b = start;
    for (State* x : {&a, &b}) {
      for (int j = 0; j < 5; ++j) x->q[std::size_t(j)] = random.normal(0, 2);
      for (int k = 0; k < 3; ++k) {
        double norm = 0.0;
        for (int j = 0; j < 3; ++j) object(*x, k)[j] = random.normal(0, 0.5);
        for (int j = 3; j < 7; ++j) norm += std::pow(object(*x, k)[j] = random.normal(0, 1), 2);
        for (int j = 3; j < 7; ++j) object(*x, k)[j] /= std::sqrt(norm);
      }
    }
    const std::vector<double> u0{random.normal(0, 1), random.normal(0, 1), random.normal(0, 1), random.normal(0, 1)};
    const std::vector<double> u1{random.normal(0, 1), random.normal(0, 1), random.normal(0, 1), random.normal(0, 1)};
    for (const double cost :
         {tests::goal_cost(geometry, b, objective.value("goal", "angle")), acceleration_cost(u0, u1),
          disturbance_cost(geometry, a, b, 1.0), tests::edge_cost(geometry, a, b, objective),
          double(toppled_objects(geometry, b, objective.value("topple", "angle"))),
          double(count_dropped(geometry, b, objective.value("drop", "height"))),
          tests::running_cost(geometry, objective, u0, u1, a, b)}) {
      ASSERT_GE(cost, 0.0);
      ASSERT_TRUE(std::isfinite(cost));
    }
  }
}

TEST(Objective, DefaultsPassTheirOwnChecks) {
  const auto ok = validate(Objective::standard());
  EXPECT_TRUE(ok) << ok.error().message;
}

TEST(Objective, IsTheSameInAnotherOrder) {
  Objective turned = Objective::standard();
  std::ranges::reverse(turned.terms);
  const Scene scene = tests::three_objects();
  const TaskGeometry geometry(scene);
  const State x = initial_state(scene);
  State y = x;
  y.q[5] += 0.011, y.q[12] += 0.017, y.q[19] -= 0.29;
  const std::vector<double> u0(4, 0.0), u1{0.1, 0.07, 0.013, 0.0};
  EXPECT_EQ(tests::running_cost(geometry, turned, u0, u1, x, y),
            tests::running_cost(geometry, Objective::standard(), u0, u1, x, y));
}

TEST(Objective, GivesDefaultsForTermsThatItLacks) {
  Objective sut;
  EXPECT_EQ(sut.weight("edge"), 0.0);
  EXPECT_EQ(sut.value("edge", "rate"), Objective::standard().value("edge", "rate"));
  sut["edge"].weight = 2;
  EXPECT_EQ(sut.weight("edge"), 2);
  EXPECT_EQ(sut.find("edge")->values, Objective::standard().find("edge")->values);
  EXPECT_EQ(sut.terms.size(), 1u);
}

TEST(ValidateObjective, NamesWhatIsWrong) {
  const auto told = [](const std::function<void(Objective&)>& spoil) {
    Objective objective = Objective::standard();
    spoil(objective);
    const auto ok = validate(objective);
    return ok ? std::string() : ok.error().message;
  };
  EXPECT_THAT(told([](Objective& o) { o.terms.push_back({.kind = "charm"}); }),
              testing::AllOf(testing::HasSubstr("got 'charm'"), testing::HasSubstr("obstruction")));
  EXPECT_THAT(told([](Objective& o) { o.terms.push_back(o.terms[0]); }), testing::HasSubstr("it twice"));
  EXPECT_THAT(told([](Objective& o) { o["edge"].values.pop_back(); }),
              testing::HasSubstr("got 2 parameters, wanted 3"));
  EXPECT_THAT(told([](Objective& o) { o.value("topple", "angle") = 4; }),
              testing::AllOf(testing::HasSubstr("objective.topple_angle: got 4 rad"), testing::HasSubstr("<= 3.142")));
}

// What an arm does to a shelf is a fact of contact, which no state tells (Eq. 4.36).
TEST_F(ObjectiveTerms, ContactCountsStepsThatHitAFixture) {
  Objective contact;
  contact["contact"].weight = 3;
  const std::vector<double> u(4, 0.0);
  Step step{.geometry = geometry, .u_before = u, .u = u, .x0 = start, .x1 = start};
  EXPECT_EQ(Scorer(contact).running(step), 0.0);
  step.facts.robot_hit_fixture = true;
  EXPECT_EQ(Scorer(contact).running(step), 3.0);
}

}  // namespace
}  // namespace jostle::physics_pool
