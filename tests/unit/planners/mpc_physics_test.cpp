// Pushing with the fine model, planned and executed in this process.

#include <gmock/gmock.h>

#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/objective/scorer.hpp"
#include "physics_pool/scenarios/push.hpp"
#include "planners/mpc/mpc.hpp"
#include "services/task/config/parameters.hpp"
#include "services/world/in_process/in_process_world.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::planners {
namespace {

using namespace physics_pool;

Outcome pushed(const Scene& scene, const MpcOptions& options) {
  const WorldPtr world = std::move(World::compile(scene)).value();
  ThreadPool pool(2);
  const auto parameters = task::load_parameters(std::string(JOSTLE_SOURCE_DIR) + "/experiments/pushing.yaml").value();
  Pbsto planner(pool, parameters.planner);
  ExecutionWorld truth(world);
  world::SimulatedRobot robot(truth);
  world::SimulatedObjects objects(truth, scene);
  const ControlSetup setup{.planner = planner,
                           .robot = robot,
                           .objects = objects,
                           .geometry = world->geometry(),
                           .objective = parameters.objective,
                           .world = std::move(pool.load(scene)).value(),
                           .seed = 1};
  auto result = run_mpc(setup, options);
  if (!result) {
    ADD_FAILURE() << result.error().message;
    return {};
  }
  return std::move(result).value();
}

TEST(MpcPhysics, PushesStraightAheadWithoutAnObstacle) {
  Scene scene = tests::push_ahead();
  scene.physics.time_step = 0.002;  // half the work, enough here
  const Outcome outcome = pushed(scene, {.first_iterations = 1, .iterations = 1});
  EXPECT_TRUE(outcome.success) << outcome.reason;
  EXPECT_LE(outcome.actions, 6);  // 0.37 m at up to 0.1 m/s
}

// The straight push collides, so the plan has to be another one.
TEST(MpcPhysics, GoesRoundTheObstacle) {
  Scene scene = std::move(generate_chapter6({.seed = 101})).value();
  scene.physics.time_step = 0.002;
  const Outcome outcome = pushed(scene, {});
  EXPECT_TRUE(outcome.success) << outcome.reason;
  const TaskGeometry geometry(scene);
  for (const State& x : outcome.observed) {
    EXPECT_FALSE(target_hits_obstacle(geometry, x));
    EXPECT_FALSE(pusher_hits_obstacle(geometry, x));
  }
  EXPECT_TRUE(at_goal(geometry, outcome.observed.back(), {}));
}

// Without noise an action ends bit-equal to the fine model's prediction.
TEST(MpcPhysics, FirstPredictionComesTrue) {
  Scene scene = tests::push_ahead();
  scene.physics.time_step = 0.002;
  const Outcome outcome = pushed(scene, {.first_iterations = 1, .iterations = 1, .max_actions = 1});
  ASSERT_EQ(outcome.observed.size(), 2u);
  EXPECT_EQ(outcome.observed[1], outcome.first_plan.states[1]);
}

}  // namespace
}  // namespace jostle::planners
