#include "planners/robustness/robust_sto.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "physics_pool/local/thread_pool.hpp"
#include "tests/support/bowl_pool.hpp"
#include "tests/support/planar.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::planners {
namespace {

using namespace tests;
using namespace physics_pool;

const TimePoint kNoDeadline = TimePoint::max();

TEST(Realizations, AreWithinTheirBoundsAndAllDifferent) {
  const ParameterBounds bounds;
  const Scene scene = three_objects();
  std::set<double> seen;
  for (int world = 1; world <= 20; ++world) {
    const Scene sut = realize(scene, bounds, 7, world);
    ASSERT_TRUE(validate(sut, "realization")) << validate(sut, "realization").error().message;
    for (std::size_t i = 0; i < sut.objects.size(); ++i) {
      const SceneObject &got = sut.objects[i], &believed = scene.objects[i];
      EXPECT_TRUE(seen.insert(got.mass).second);
      EXPECT_TRUE(seen.insert(got.friction).second);
      EXPECT_TRUE(got.mass >= 0.5 && got.mass <= 0.8);
      EXPECT_TRUE(got.friction >= 0.2 && got.friction <= 0.4);
      EXPECT_NEAR(got.size[0], believed.size[0], 0.005);
      EXPECT_NEAR(got.radius, believed.radius, 0.005);
      EXPECT_NEAR(got.height, believed.height, 0.005);
      EXPECT_EQ(got.shape == Shape::kBox, got.radius == 0);
    }
    EXPECT_EQ(scene_hash(realize(scene, bounds, 7, world)), scene_hash(sut));
    EXPECT_NE(scene_hash(realize(scene, bounds, 8, world)), scene_hash(sut));
  }
}

TEST(Realizations, DoNotGrowIntoTheirNeighbours) {
  Scene scene = three_objects();
  scene.objects[1] = box("neighbour", 0.0405, 0.0);  // 0.5 mm beside the target
  for (int world = 1; world <= 30; ++world) EXPECT_TRUE(validate(realize(scene, {}, 3, world), "realization"));
}

TEST(NearbyStarts, HaveTheSpreadThatWasAskedFor) {
  const Scene scene = three_objects();
  const State x0 = initial_state(scene);
  const StateLayout layout = layout_of(scene);
  double square = 0.0, turn = 0.0;
  constexpr int kStarts = 2000;
  for (int i = 0; i < kStarts; ++i) {
    const State x = nearby_start(scene, scene, x0, {.position = 0.002, .rotation = 0.01}, 5, i);
    EXPECT_TRUE(std::equal(x.q.begin(), x.q.begin() + 5, x0.q.begin())) << "the robot stays";
    EXPECT_EQ(x.v, x0.v);
    const ObjectView carton(layout.objects[2], x), before(layout.objects[2], x0);
    square += std::pow(carton.position()[0] - before.position()[0], 2);
    turn += std::pow(std::remainder(carton.yaw() - before.yaw(), 6.283185307179586), 2);
    EXPECT_NEAR(carton.position()[2], before.position()[2], 1e-12);
  }
  // Five standard errors of a variance: 5·sqrt(2/2000) of it.
  EXPECT_NEAR(square / kStarts, 4e-6, 0.16 * 4e-6);
  EXPECT_NEAR(turn / kStarts, 1e-4, 0.16 * 1e-4);
}

TEST(NearbyStarts, StandAsHighAsTheirWorldHasIt) {
  const Scene scene = three_objects();
  const Scene world = realize(scene, {}, 5, 1);
  const State x = nearby_start(scene, world, initial_state(scene), {}, 5, 0);
  const StateLayout layout = layout_of(scene);
  for (std::size_t i = 0; i < layout.objects.size(); ++i) {
    EXPECT_NEAR(ObjectView(layout.objects[i], x).position()[2], world.objects[i].rest_height(), 1e-12);
  }
}

TEST(NearbyStarts, AreTheSameInEveryWorldWhereThereIsRoom) {
  const Scene scene = target_only();
  const State here = nearby_start(scene, scene, initial_state(scene), {}, 5, 3);
  const State there = nearby_start(scene, realize(scene, {}, 5, 2), initial_state(scene), {}, 5, 3);
  EXPECT_EQ(here.q[5], there.q[5]);
  EXPECT_EQ(here.q[6], there.q[6]);
  EXPECT_NE(here.q[5], 0.0);
}

TEST(NearbyStarts, AreNeverInsideEachOther) {
  Scene scene = three_objects();
  scene.objects[1] = box("neighbour", 0.0405, 0.0);
  for (int i = 0; i < 50; ++i) {
    const State x = nearby_start(scene, scene, initial_state(scene), {}, 1, i);
    Scene at_x = scene;
    const StateLayout layout = layout_of(scene);
    for (std::size_t k = 0; k < at_x.objects.size(); ++k) {
      const ObjectView seen(layout.objects[k], x);
      at_x.objects[k].x = seen.position()[0];
      at_x.objects[k].y = seen.position()[1];
      at_x.objects[k].yaw = seen.yaw();
    }
    EXPECT_FALSE(overlap(at_x.objects[0], at_x.objects[1], -0.0005));
  }
}

// A disc of 4 cm and a box of 5 cm, the one behind the other along x; N_c and N_w as a test has them.
class PushedBox : public testing::Test {
 protected:
  PushedBox() {
    scene.robot = pusher({.x = -0.15, .radius = 0.04});
    scene.objects = {box("target", 0.0, 0.0)};
    scene.objects[0].size = {0.05, 0.05, 0.05};
    scene.task = {.kind = "push", .target = "target", .goal = {.x = 0.25, .y = 0.2, .radius = 0.04}};
    scene.surface = Surface::table(1.0, 0.8);
    options = {.starts = 8, .worlds = 0};
  }

  // Plans nothing: the metrics are those of these controls, each held for 1 s.
  Plan metrics(const std::vector<std::array<double, 2>>& controls, int threads = 2) {
    ThreadPool pool(threads);
    const TaskGeometry geometry(scene);
    Problem problem{.world = pool.load(scene).value(), .x0 = initial_state(scene)};
    for (const auto& u : controls) problem.initial.append(u);
    problem.iterations = iterations;
    problem.seed = 4;
    PbstoOptions optimizer{.rollouts = 3, .sigma = {0.02, 0.02}, .limit = {0.3, 0.3}};
    RobustSto sut(pool, scene, geometry, optimizer, options);
    auto result = sut.plan(problem, kNoDeadline);
    if (!result) {
      ADD_FAILURE() << result.error().message;
      return {};
    }
    return std::move(result).value();
  }

  Scene scene;
  RobustStoOptions options;
  int iterations = 0;
};

TEST_F(PushedBox, ByNobodyKeepsItsDeviations) {
  options.worlds = 3;
  const Plan sut = metrics({{-0.05, 0.0}, {-0.05, 0.05}});  // away from it
  EXPECT_NEAR(sut.robustness->expected.value, 1.0, 0.01);
  EXPECT_NEAR(sut.robustness->maximal.value, 1.0, 0.01);
  ASSERT_EQ(sut.robustness->segments.size(), 1u);
  EXPECT_TRUE(sut.robustness->segments[0].is_robust);
}

// Walls ahead and to the left: whatever the box started from, it ends in their corner.
TEST_F(PushedBox, IntoACornerConverges) {
  scene.fixtures = {{.name = "ahead", .size = {0.02, 0.3, 0.1}, .pose = {.position = {0.06, 0.0, 0.05}}},
                    {.name = "left", .size = {0.3, 0.02, 0.1}, .pose = {.position = {-0.1, 0.06, 0.05}}}};
  scene.robot = pusher({.x = -0.08, .y = -0.08, .radius = 0.04});
  options.worlds = 3;
  const Plan sut = metrics({{0.035, 0.035}, {0.02, 0.02}});
  RecordProperty("expected", std::to_string(sut.robustness->expected.value));
  EXPECT_LT(sut.robustness->nominal_expected.value, 0.6) << sut.robustness->nominal_expected.spread;
  EXPECT_LT(sut.robustness->expected.value, 1.0) << sut.robustness->expected.spread;
}

TEST_F(PushedBox, AtItsEdgeDiverges) {
  scene.robot = pusher({.x = -0.08, .y = 0.04, .radius = 0.04});  // the box reaches to 0.025
  options.starts = 16;
  const Plan sut = metrics({{0.08, 0.0}, {0.08, 0.0}});
  EXPECT_GT(sut.robustness->expected.value, 1.0 + 3 * sut.robustness->expected.spread);
  EXPECT_FALSE(sut.robustness->segments.back().is_robust);
}

TEST_F(PushedBox, GivesTheSameMetricsOnAnyNumberOfThreads) {
  scene.robot = pusher({.x = -0.08, .y = 0.02, .radius = 0.04});
  options.worlds = 2;
  options.starts = 2;
  iterations = 2;
  const Plan one = metrics({{0.08, 0.0}, {0.08, 0.0}}, 1), three = metrics({{0.08, 0.0}, {0.08, 0.0}}, 3);
  EXPECT_EQ(one.controls, three.controls);
  EXPECT_EQ(one.states, three.states);
  EXPECT_EQ(one.cost, three.cost);
  EXPECT_EQ(one.robustness, three.robustness);
  EXPECT_EQ(one.iterations, 2);
  EXPECT_EQ(one.rollouts, (3u * 2 + 1) * (2 * (2 + 1) + 1));
}

// A bowl is one world: costs are known in closed form, and what was asked for can be looked at.
class RobustBowl : public testing::Test {
 protected:
  Plan plan() {
    RobustSto sut(pool, scene, geometry, optimizer, options);
    auto result = sut.plan(problem, kNoDeadline);
    if (!result) {
      ADD_FAILURE() << result.error().message;
      return {};
    }
    return std::move(result).value();
  }

  const Scene scene = target_only();
  const TaskGeometry geometry{scene};
  BowlPool pool{{0.1, 0.05, 0.0, 0.0}};
  PbstoOptions optimizer{.rollouts = 4};
  RobustStoOptions options;
  Problem problem = [this] {
    Problem bowl = bowl_problem(3);
    bowl.x0 = initial_state(scene);
    return bowl;
  }();
};

// Eq. 4.42: (S·I + 1)·(N_c·(N_w + 1) + 1).
TEST_F(RobustBowl, AsksForAsManyRolloutsAsTheThesisCounts) {
  const Plan sut = plan();
  EXPECT_EQ(sut.iterations, 3);
  EXPECT_EQ(sut.rollouts, (4u * 3 + 1) * (4 * (4 + 1) + 1));
  ASSERT_EQ(pool.batches.size(), 4u * 21);
  // Every batch of an iteration has the same samples of the same controls, whatever its world and start.
  for (std::size_t b = 21; b < 42; ++b) {
    EXPECT_EQ(pool.batches[b].nominal, pool.batches[21].nominal);
    EXPECT_EQ(pool.batches[b].law.stream, pool.batches[21].law.stream);
    EXPECT_EQ(pool.batches[b].samples, 4u);
    EXPECT_FALSE(pool.batches[b].stop_losers);
  }
  EXPECT_NE(pool.batches[42].law.stream, pool.batches[21].law.stream);
}

TEST_F(RobustBowl, MeetsTheSameWorldsAndStartsInEveryIteration) {
  plan();
  std::set<std::string> worlds;
  for (std::size_t b = 0; b < 21; ++b) {
    worlds.insert(to_string(pool.batches[b].world));
    for (std::size_t i = 1; i < 4; ++i) {
      EXPECT_EQ(pool.batches[21 * i + b].x0, pool.batches[b].x0);
      EXPECT_EQ(pool.batches[21 * i + b].world, pool.batches[b].world);
    }
  }
  EXPECT_EQ(worlds.size(), 5u);
}

TEST_F(RobustBowl, WeighsMetricsBesideCosts) {
  options.expected_weight = 2.0;
  options.maximal_weight = 0.5;
  options.cost_weight = 3.0;
  problem.iterations = 0;
  const Plan sut = plan();  // in a bowl objects stay where they start: all metrics are 1
  EXPECT_NEAR(sut.cost, 2.0 + 0.5 + 3.0 * pool.cost(problem.initial), 1e-6);
}

TEST_F(RobustBowl, WithoutRobustnessAsksForCostsAlone) {
  problem.weigh_robustness = false;
  const Plan sut = plan();
  EXPECT_EQ(sut.rollouts, 4u * 3 + 1);
  EXPECT_EQ(sut.cost, pool.cost(sut.controls));
  EXPECT_FALSE(sut.robustness);
}

// alpha, beta and E: each of them alone keeps the search going.
TEST_F(RobustBowl, EndsOnceItIsFeasibleAndRobust) {
  problem.objective = Objective{.success_cost = 1e6};  // no final cost: every state is terminal
  EXPECT_EQ(plan().iterations, 0);
  problem.objective.success_cost = 1.0;  // beta
  EXPECT_EQ(plan().iterations, 3);
  problem.objective.success_cost = 1e6;
  problem.objective["pads"].weight = 1e4;  // alpha: 25 cm from the target
  EXPECT_EQ(plan().iterations, 3);
  options.terminal_cost = 1e4;
  EXPECT_EQ(plan().iterations, 0);
  options.tolerance = -0.1;  // E is 1
  EXPECT_EQ(plan().iterations, 3);
}

TEST_F(RobustBowl, NeverTakesWhatBreaksInAWorldForRobust) {
  pool.diverges = [&](const RolloutBatch& batch, std::uint32_t) { return batch.world != problem.world; };
  const Plan sut = plan();
  EXPECT_EQ(sut.robustness->expected.value, kInfinity);
  EXPECT_EQ(sut.robustness->expected.spread, kInfinity);
  EXPECT_NEAR(sut.robustness->nominal_expected.value, 1.0, 1e-6);
  for (const Segment& segment : sut.robustness->segments) EXPECT_FALSE(segment.is_robust);
}

}  // namespace
}  // namespace jostle::planners
