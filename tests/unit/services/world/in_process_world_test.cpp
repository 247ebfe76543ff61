#include "services/world/in_process/in_process_world.hpp"

#include <gmock/gmock.h>

#include <chrono>
#include <cmath>

#include "tests/support/scenes.hpp"

namespace jostle::world {
namespace {

using physics_pool::Uncertainty;

class InProcessWorld : public testing::Test {
 protected:
  physics_pool::Scene scene = tests::three_objects();
  physics_pool::WorldPtr world = std::move(physics_pool::World::compile(scene)).value();
  physics_pool::ExecutionWorld execution{world};
};

TEST_F(InProcessWorld, RobotReadsItsJointsAndWhetherTheTargetIsInTheHand) {
  SimulatedRobot sut(execution);
  const auto reading = sut.read();
  ASSERT_TRUE(reading);
  EXPECT_THAT(reading->q, testing::ElementsAre(scene.robot.q[0], 0, 0, 0.0425, 0.0425));
  EXPECT_THAT(reading->v, testing::Each(0.0));
  EXPECT_EQ(reading->object_in_hand, std::optional(false));
}

TEST_F(InProcessWorld, RobotFeelsTheTargetInTheHand) {
  scene.robot.q[0] = -0.035;
  world = std::move(physics_pool::World::compile(scene)).value();
  physics_pool::ExecutionWorld near(world);
  SimulatedRobot sut(near);
  EXPECT_EQ(sut.read()->object_in_hand, std::optional(true));
}

TEST(InProcessPush, PusherHasTwoJointsAndFeelsNothing) {
  const physics_pool::Scene scene = tests::push_ahead();
  physics_pool::ExecutionWorld execution(std::move(physics_pool::World::compile(scene)).value());
  SimulatedRobot sut(execution);
  const auto reading = sut.read();
  ASSERT_TRUE(reading);
  EXPECT_THAT(reading->q, testing::ElementsAre(scene.robot.q[0], scene.robot.q[1]));
  EXPECT_EQ(reading->object_in_hand, std::nullopt);
  EXPECT_FALSE(sut.execute(std::vector{0.1, 0.0, 0.0, 0.0}, 0.1, {}));
  EXPECT_TRUE(sut.execute(std::vector{0.1, 0.0}, 0.1, {}));
}

TEST_F(InProcessWorld, RobotKeepsTimeWithTheClockWhenToldTo) {
  const std::vector<double> u{0.1, 0.05, 0.2, -0.01};
  physics_pool::ExecutionWorld other(world);
  SimulatedRobot at_once(other), sut(execution, 2.0);
  ASSERT_TRUE(at_once.execute(u, 0.1, {}));
  const auto start = std::chrono::steady_clock::now();
  ASSERT_TRUE(sut.execute(u, 0.1, {}));
  EXPECT_GE(std::chrono::steady_clock::now() - start, std::chrono::milliseconds(50));
  EXPECT_EQ(execution.state(), other.state());
}

TEST_F(InProcessWorld, RobotExecutesLikeThePlannersModel) {
  SimulatedRobot sut(execution);
  const std::vector<double> u{0.1, 0.05, 0.2, -0.01};
  ASSERT_TRUE(sut.execute(u, 0.5, {}));
  physics_pool::Simulator model(world);
  State x = initial_state(scene);
  (void)model.advance(x, u, 250);
  EXPECT_EQ(execution.state(), x);
  EXPECT_NEAR(execution.time(), 0.5, 1e-12);
}

TEST_F(InProcessWorld, RobotStopsWhenAsked) {
  SimulatedRobot sut(execution);
  std::stop_source stop;
  stop.request_stop();
  const auto ok = sut.execute(std::vector<double>{0.1, 0, 0, 0}, 0.5, stop.get_token());
  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().code, Code::kCancelled);
  EXPECT_EQ(execution.time(), 0.0);
}

TEST_F(InProcessWorld, RobotRefusesControlsItsPortForbids) {
  SimulatedRobot sut(execution);
  for (const std::vector<double>& u :
       {std::vector<double>{0.1, 0, 0}, {0, 0, 0, 0, 0}, {0, std::nan(""), 0, 0}, {HUGE_VAL, 0, 0, 0}}) {
    const auto ok = sut.execute(u, 0.1, {});
    ASSERT_FALSE(ok);
    EXPECT_EQ(ok.error().code, Code::kInvalidArgument);
  }
  EXPECT_EQ(execution.time(), 0.0);
}

TEST_F(InProcessWorld, ObjectsAreSeenAsTheyAreWithoutUncertainty) {
  SimulatedObjects sut(execution, scene);
  const auto readings = sut.read();
  ASSERT_TRUE(readings);
  ASSERT_EQ(readings->size(), 3u);
  const perception::ObjectReading& carton = (*readings)[2];
  EXPECT_EQ(carton.name, "carton");
  EXPECT_THAT(carton.position, testing::ElementsAre(0.1, -0.1, 0.019));
  EXPECT_DOUBLE_EQ(carton.orientation[0], std::cos(0.25));
  EXPECT_DOUBLE_EQ(carton.orientation[3], std::sin(0.25));
  EXPECT_THAT(carton.linear, testing::Each(0.0));
}

TEST_F(InProcessWorld, OnlyReadingsBeforeTheFirstActionHaveTheErrorsOfThePlanningWorld) {
  const physics_pool::Scene belief = physics_pool::perturb(scene, Uncertainty::kLow, 1);
  SimulatedObjects sut(execution, belief);
  for (int i = 0; i < 2; ++i) EXPECT_EQ(sut.read()->at(0).position[0], belief.objects[0].x);
  ASSERT_TRUE(execution.step());
  EXPECT_EQ(sut.read()->at(0).position[0],
            execution.state().q[static_cast<std::size_t>(layout_of(scene).objects[0].q)]);
}

TEST_F(InProcessWorld, ReadingsHoldTheWholeState) {
  State x = initial_state(scene);
  for (std::size_t i = 0; i < x.v.size(); ++i) x.v[i] = double(i);
  const auto readings = object_readings(layout_of(scene), x);
  ASSERT_EQ(readings.size(), 3u);
  EXPECT_THAT(readings[1].linear, testing::ElementsAre(11, 12, 13));
  EXPECT_THAT(readings[1].angular, testing::ElementsAre(14, 15, 16));
}

}  // namespace
}  // namespace jostle::world
