#include "services/task/session/composition.hpp"

#include <gmock/gmock.h>

#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/local/thread_pool.hpp"
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
