#include "services/task/session/composition.hpp"

#include <gmock/gmock.h>

#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/local/thread_pool.hpp"
#include "physics_pool/scenarios/chapter5.hpp"
#include "services/world/in_process/in_process_world.hpp"
#include "tests/support/scenes.hpp"

namespace jostle::tests {
namespace {

using ::testing::HasSubstr;

task::Parameters guided_by(int candidates) {
  task::Parameters parameters;
  parameters.guidance.candidates = candidates;
  return parameters;
}

// Whether coarse physics guides a run with these parameters; the run is cancelled before it plans.
bool is_guided(const physics_pool::Scene& scene, const task::Parameters& parameters) {
  physics_pool::ThreadPool pool(1);
  auto sut_result = task::Composition::make(
      {.belief = scene, .belief_is_exact = true, .parameters = parameters, .controller = "or"}, pool);
  EXPECT_TRUE(sut_result);
  physics_pool::ExecutionWorld world(physics_pool::World::compile(scene).value());
  world::SimulatedRobot robot(world);
  world::SimulatedObjects objects(world, scene);
  std::stop_source stop;
  stop.request_stop();
  bool guided = false;
  const auto look = [&](planners::Planner& planner) -> std::unique_ptr<planners::Planner> {
    guided = dynamic_cast<planners::GuidedPlanner*>(&planner) != nullptr;
    return nullptr;
  };
  (void)sut_result->perform(robot, objects, {.on_event = {}, .on_progress = {}, .around_planner = look},
                            stop.get_token());
  return guided;
}

TEST(Composition, PlansWithGuidanceWhereItIsAskedFor) {
  EXPECT_TRUE(is_guided(three_objects(), guided_by(60)));
  EXPECT_FALSE(is_guided(three_objects(), guided_by(0)));
}

TEST(Composition, PlansWithoutGuidanceForAHandThatCoarsePhysicsCannotShow) {
  physics_pool::Scene scene = three_objects();
  scene.robot.model.links[0].geoms[0].pose.orientation = {0.995, 0.0998, 0.0, 0.0};  // tilted by 0.2 rad
  EXPECT_FALSE(is_guided(scene, guided_by(60)));
}

// Physics predicts the world that it simulates: every plan that was made while acting is used. A rest is part of an
// action.
TEST(Composition, PlansWhileActingFromWhatAnActionComesTo) {
  const auto scene_result = physics_pool::generate_chapter5({.task = physics_pool::AdaptiveTask::kStrip, .seed = 11});
  ASSERT_TRUE(scene_result);
  task::Parameters parameters = task::parse_parameters(
                                    "planner: {rollouts: 2, sigma: [0.02, 0.02, 0.1, 0], limit: [0.5, 0.5, 1, 0.05]}\n"
                                    "adaptive: {sequences: 2, least_actions: 5, most_actions: 6, samples: 2, "
                                    "iterations: 0, max_actions: 4}\n"
                                    "control: {plan_while_acting: 0.001}\n",
                                    "test")
                                    .value();
  physics_pool::ThreadPool pool(1);
  auto sut_result = task::Composition::make(
      {.belief = *scene_result, .belief_is_exact = true, .parameters = parameters, .controller = "tampc"}, pool);
  ASSERT_TRUE(sut_result) << sut_result.error().message;
  physics_pool::ExecutionWorld world(physics_pool::World::compile(*scene_result).value());
  world::SimulatedRobot robot(world);
  world::SimulatedObjects objects(world, *scene_result);
  std::vector<planners::PlanOrigin> origins;
  const auto outcome_result =
      sut_result->perform(robot, objects,
                          {.on_plan = [&](const planners::Problem&, const planners::Plan&,
                                          const planners::PlanOrigin& origin) { origins.push_back(origin); }},
                          {});
  ASSERT_TRUE(outcome_result) << outcome_result.error().message;
  EXPECT_EQ(outcome_result->taken_ahead, 3);
  ASSERT_EQ(origins.size(), 4u);
  for (std::size_t i = 1; i < 4; ++i) EXPECT_LT(origins[i].deviation.value_or(1.0), 1e-4);
}

TEST(Composition, RefusesGuidanceForAControllerWithAPlannerOfItsOwn) {
  physics_pool::ThreadPool pool(1);
  const auto result = task::Composition::make(
      {.belief = three_objects(), .belief_is_exact = true, .parameters = guided_by(60), .controller = "tampc"}, pool);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Code::kInvalidArgument);
  EXPECT_THAT(result.error().message, HasSubstr("planner.guidance: got 60 candidates for the controller 'tampc'"));
}

}  // namespace
}  // namespace jostle::tests
