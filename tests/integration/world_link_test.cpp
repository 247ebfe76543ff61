// Both ends of the world's wire, and the coordinator's, against made-up peers.

#include <fmt/format.h>
#include <gmock/gmock.h>

#include <functional>

#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/world/link/messages.hpp"
#include "services/world/link/world_client.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace jostle_msgs::msg;
using ::testing::HasSubstr;
using world::ObjectsClient;
using world::RobotClient;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr world::WorldClientOptions kImpatient{.silence = 300ms, .start = 500ms};

class WorldLink : public RunFixture {
 protected:
  auto deadline() const { return std::chrono::steady_clock::now() + kPatience; }

  const wire::Participant participant = wire::Participant::open({.domain = domain}).value();
};

// A world that is only what a test says.
class MadeUpWorld : public WorldLink {
 protected:
  void say(const ObjectStates& states) {
    ASSERT_TRUE(objects_writer.wait_for_readers(deadline()));
    ASSERT_TRUE(objects_writer.write(states));
  }

  ObjectStates good_states() {
    return world::to_message({{.name = "target", .position = {1, 2, 3}, .orientation = {1, 0, 0, 0}}}, 0.5);
  }

  wire::Writer<ObjectStates> objects_writer{participant, wire::topics::kObjectStates};
  wire::Writer<RobotStatus> status_writer{participant, wire::topics::kRobotStatus};
  RobotClient robot{participant, kImpatient};
  ObjectsClient objects{participant, robot, kImpatient};
};

TEST_F(MadeUpWorld, OnlyBadObjectsAreAnErrorThatNamesTheField) {
  const std::pair<const char*, std::function<void(ObjectState&)>> cases[] = {
      {".pose.position.x: got nan", [](ObjectState& s) { s.pose().position().x(kNaN); }},
      {".pose.orientation.w: got inf", [](ObjectState& s) { s.pose().orientation().w(1 / 0.0); }},
      {".pose.orientation: got norm 2", [](ObjectState& s) { s.pose().orientation().w(2.0); }},
      {".angular.z: got nan", [](ObjectState& s) { s.angular().z(kNaN); }}};
  std::uint64_t rejected = 0;
  for (const auto& [problem, spoil] : cases) {
    ObjectStates states = good_states();
    spoil(states.objects()[0]);
    ASSERT_NO_FATAL_FAILURE(say(states));

    const auto readings_result = objects.read();

    ASSERT_FALSE(readings_result);
    EXPECT_EQ(readings_result.error().code, Code::kInvalidArgument);
    EXPECT_THAT(readings_result.error().message, HasSubstr("rt/objects/states: objects[0] ('target')"));
    EXPECT_THAT(readings_result.error().message, HasSubstr(problem));
    EXPECT_EQ(objects.rejected(), ++rejected);
  }
}

TEST_F(MadeUpWorld, GoodObjectsAfterBadOnesAreTaken) {
  ObjectStates bad = good_states();
  bad.objects()[0].pose().position().x(kNaN);
  ASSERT_NO_FATAL_FAILURE(say(bad));
  ASSERT_NO_FATAL_FAILURE(say(good_states()));

  const auto readings_result = objects.read();

  ASSERT_TRUE(readings_result) << readings_result.error().message;
  ASSERT_EQ(readings_result->size(), 1u);
  EXPECT_EQ(readings_result->front().position, (std::array<double, 3>{1, 2, 3}));
}

TEST_F(MadeUpWorld, SilenceIsAnErrorThatSaysWhatToStart) {
  const auto robot_result = robot.read();
  const auto objects_result = objects.read();

  ASSERT_FALSE(robot_result);
  ASSERT_FALSE(objects_result);
  EXPECT_EQ(robot_result.error().code, Code::kUnavailable);
  EXPECT_THAT(robot_result.error().message, HasSubstr("nobody publishes rt/robot/status"));
  EXPECT_THAT(objects_result.error().message, HasSubstr("nobody publishes rt/objects/states"));
  EXPECT_THAT(objects_result.error().message, HasSubstr("jostle sim"));
}

TEST_F(MadeUpWorld, OnlyBadRobotStatesAreAnErrorThatNamesTheField) {
  RobotStatus status;
  status.q({0.0, kNaN});
  ASSERT_TRUE(status_writer.wait_for_readers(deadline()));
  // While it reads: what came before is yesterday's news.
  const std::jthread speaker([&](std::stop_token stop) {
    soon(kPatience, [&] { return !status_writer.write(status) || stop.stop_requested(); });
  });

  const auto robot_result = robot.read();

  ASSERT_FALSE(robot_result);
  EXPECT_EQ(robot_result.error().code, Code::kInvalidArgument);
  EXPECT_THAT(robot_result.error().message, HasSubstr("rt/robot/status: q[1]: got nan"));
}

// Two commands to a robot that refuses the first and repeats that until the second is done.
TEST_F(MadeUpWorld, RefusalIsOfOneCommandOnly) {
  wire::Inbox<VelocityCommand> commands{participant, wire::topics::kRobotCommand, 64};
  const std::jthread other_side([&](std::stop_token stop) {
    RobotStatus status;
    status.q({0.0, 0.0});
    status.v({0.0, 0.0});
    status.limits({2.0, 2.0});
    int repeats = 0;
    soon(kPatience, [&] {
      for (const VelocityCommand& command : commands.take_all()) {
        status.epoch(command.epoch());
        if (command.sequence_number() == 1) status.error("command 1: too early");
        if (command.sequence_number() == 2) repeats = 10;
      }
      if (repeats > 0 && --repeats == 0) {
        status.error("");
        status.sequence_number(2);
      }
      return !status_writer.write(status) || stop.stop_requested();
    });
  });
  const std::vector<double> u{0.1, 0.0};

  const auto first = robot.execute(u, 0.1, {}), second = robot.execute(u, 0.1, {});

  ASSERT_FALSE(first);
  EXPECT_EQ(first.error().code, Code::kInvalidArgument);
  EXPECT_THAT(first.error().message, HasSubstr("command 1: too early"));
  EXPECT_TRUE(second) << second.error().message;
}

// A robot that does not say that it stopped.
TEST_F(MadeUpWorld, StopThatIsNotObeyedIsAnError) {
  wire::Inbox<VelocityCommand> commands{participant, wire::topics::kRobotCommand, 64};
  std::stop_source stop_action;
  std::vector<VelocityCommand> heard;
  Result<void> ok;
  {
    const std::jthread other_side([&](std::stop_token stop) {
      RobotStatus status;
      status.q({0.0, 0.0});
      status.v({0.0, 0.0});
      status.limits({2.0, 2.0});
      soon(kPatience, [&] {
        for (const VelocityCommand& command : commands.take_all()) {
          heard.push_back(command);
          status.epoch(command.epoch());
          status.busy(true);
          stop_action.request_stop();
        }
        return !status_writer.write(status) || stop.stop_requested();
      });
    });
    ok = robot.execute(std::vector{0.1, 0.0}, 0.1, stop_action.get_token());
  }

  ASSERT_FALSE(ok);
  EXPECT_EQ(ok.error().code, Code::kUnavailable);
  EXPECT_THAT(ok.error().message, HasSubstr("told to stop, and not heard to stand still"));
  ASSERT_EQ(heard.size(), 2u);
  EXPECT_TRUE(world::is_stop(heard[1]));
  EXPECT_EQ(heard[1].sequence_number(), 2u);
}

// jostle_sim, commanded by hand.
class SimulatedWorldProcess : public WorldLink {
 protected:
  void SetUp() override { ASSERT_TRUE(commands.wait_for_readers(deadline())) << sim->err(); }

  static VelocityCommand command(std::uint64_t epoch, std::uint64_t number) {
    VelocityCommand command;
    command.epoch(epoch);
    command.sequence_number(number);
    command.velocities({0.05, 0.0, 0.0, 0.0});
    command.duration(0.2);
    return command;
  }

  // The first status that fits, or nothing.
  std::optional<RobotStatus> status_that(const std::function<bool(const RobotStatus&)>& fits) {
    const auto end = deadline();
    while (auto status = statuses.take(end)) {
      if (fits(*status)) return status;
    }
    return {};
  }

  std::optional<RobotStatus> finished(std::uint64_t epoch, std::uint64_t number) {
    return status_that([=](const RobotStatus& status) {
      return status.epoch() == epoch && status.sequence_number() == number && !status.busy();
    });
  }

  const std::unique_ptr<ProgramProcess> sim = program("jostle_sim", {easy});
  wire::Inbox<RobotStatus> statuses{participant, wire::topics::kRobotStatus, 64};
  wire::Writer<VelocityCommand> commands{participant, wire::topics::kRobotCommand};
};

TEST_F(SimulatedWorldProcess, RefusesBadCommandsByFieldAndTakesTheNextGoodOne) {
  const std::pair<const char*, std::function<void(VelocityCommand&)>> cases[] = {
      {"velocities: got 3 values, wanted 4",
       [](auto& c) {
         c.velocities({0.0, 0.0, 0.0});
       }},
      {"velocities: got 64 values, wanted 4", [](auto& c) { c.velocities(std::vector<double>(64, 0.0)); }},
      {"velocities[2]: got nan",
       [](auto& c) {
         c.velocities({0.0, 0.0, kNaN, 0.0});
       }},
      {"velocities[0]: got 1e+300",
       [](auto& c) {
         c.velocities({1e300, 0.0, 0.0, 0.0});
       }},
      {"duration: got nan", [](auto& c) { c.duration(kNaN); }},
      {"duration: got -1", [](auto& c) { c.duration(-1.0); }},
      {"duration: got 1e+18", [](auto& c) { c.duration(1e18); }}};
  std::uint64_t number = 0;
  EXPECT_TRUE(commands.write(command(5, ++number)));
  auto before = finished(5, number);
  ASSERT_TRUE(before);
  for (const auto& [problem, spoil] : cases) {
    VelocityCommand bad = command(5, ++number);
    spoil(bad);
    EXPECT_TRUE(commands.write(bad));

    const auto refusal = status_that([](const RobotStatus& status) { return !status.error().empty(); });

    ASSERT_TRUE(refusal) << sim->err();
    EXPECT_THAT(refusal->error(), HasSubstr(fmt::format("command {}: {}", number, problem)));
    EXPECT_EQ(refusal->q(), before->q());
    EXPECT_EQ(refusal->sequence_number(), number);  // nobody waits for it any longer
    EXPECT_TRUE(commands.write(command(5, ++number)));
    const auto after = finished(5, number);
    ASSERT_TRUE(after) << sim->err();
    EXPECT_EQ(after->error(), "");
    // Moves back, so that all cases start from the same place.
    VelocityCommand back = command(5, ++number);
    back.velocities({-0.05, 0.0, 0.0, 0.0});
    EXPECT_TRUE(commands.write(back));
    const auto home = finished(5, number);
    ASSERT_TRUE(home);
    EXPECT_NEAR(home->q()[0], before->q()[0], 5e-3);
    before = home;
  }
}

TEST_F(SimulatedWorldProcess, DropsCommandsOfAnOlderEpochAndOnesAlreadyDone) {
  EXPECT_TRUE(commands.write(command(5, 1)));
  const auto first = finished(5, 1);
  ASSERT_TRUE(first) << sim->err();
  EXPECT_GT(first->q()[0], -0.33 + 5e-3);

  EXPECT_TRUE(commands.write(command(5, 1)));  // repeated by a sender that has not heard yet that it is done
  EXPECT_TRUE(commands.write(command(5, 2)));
  const auto second = finished(5, 2);
  ASSERT_TRUE(second) << sim->err();
  EXPECT_LT(second->q()[0] - first->q()[0], 1.5 * (first->q()[0] + 0.33));  // once, not twice

  EXPECT_TRUE(commands.write(command(5, 1)));
  ASSERT_TRUE(sim->says("command 5/1 is stale, dropped", kPatience)) << sim->err();
  const auto after = status_that([](const RobotStatus& status) { return !status.busy(); });
  ASSERT_TRUE(after);
  EXPECT_EQ(after->epoch(), 5u);
  EXPECT_EQ(after->q(), second->q());

  EXPECT_TRUE(commands.write(command(4, 1)));  // a new task counts anew; epochs have no order
  EXPECT_TRUE(finished(4, 1)) << sim->err();
  EXPECT_TRUE(commands.write(command(5, 3)));  // what is over stays over
  ASSERT_TRUE(sim->says("command 5/3 is stale, dropped", kPatience)) << sim->err();
}

// Clocks may differ, or go back: what counts is who is there.
TEST_F(SimulatedWorldProcess, ObeysANewcomerOnceItsCommanderHasGone) {
  EXPECT_TRUE(commands.write(command(5, 1)));
  ASSERT_TRUE(finished(5, 1)) << sim->err();
  const auto coordinator = program("jostle_coordinator", {"--pool", "threads", "--threads", "1"});
  wire::Writer<Goal> goals{participant, wire::topics::kTaskGoal};
  wire::Inbox<GoalResult> results{participant, wire::topics::kTaskResult, 64};
  ASSERT_TRUE(goals.wait_for_readers(deadline())) << coordinator->err();
  ASSERT_TRUE(soon(kPatience, [&] { return results.matched() == 1; }));
  Goal goal;
  goal.goal_id("act");
  goal.execution_scene(contents(easy));
  goal.planning_scene(contents(easy));
  goal.parameters("control: {many_iterations: 10}\n");
  goal.controller("or");

  EXPECT_TRUE(goals.write(goal));
  const auto refused = results.take(deadline());
  ASSERT_TRUE(refused);
  EXPECT_THAT(refused->error(), HasSubstr("robot: it obeys another commander, of epoch 5"));

  { const auto gone = std::move(commands); }
  goal.goal_id("act again");
  EXPECT_TRUE(goals.write(goal));
  const auto result = results.take(deadline());
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->success()) << result->error() << sim->err();
}

TEST_F(SimulatedWorldProcess, BadCommandOfAStrangerIsNotTheCommandersError) {
  EXPECT_TRUE(commands.write(command(5, 1)));
  ASSERT_TRUE(finished(5, 1)) << sim->err();
  VelocityCommand bad = command(9, 1);
  bad.duration(kNaN);

  EXPECT_TRUE(commands.write(bad));

  ASSERT_TRUE(sim->says("duration: got nan", kPatience)) << sim->err();
  EXPECT_TRUE(commands.write(command(5, 2)));
  const auto after = finished(5, 2);
  ASSERT_TRUE(after) << sim->err();
  EXPECT_EQ(after->error(), "");
}

TEST_F(SimulatedWorldProcess, SaysThatItsGripperIsEmpty) {
  const auto status = statuses.take(deadline());
  ASSERT_TRUE(status) << sim->err();
  EXPECT_EQ(status->in_hand(), RobotStatus_Constants::EMPTY);
}

// It says much and obeys nobody, and was heard first.
TEST_F(WorldLink, APlaybackBesideAWorldIsNotTakenForIt) {
  RobotStatus played;
  played.q({9, 9, 9, 9, 9});
  ObjectStates played_objects = world::to_message({{.name = "played", .orientation = {1, 0, 0, 0}}}, 0.5);
  const auto player = wire::Participant::open({.domain = domain}).value();
  wire::Writer<RobotStatus> played_status(player, wire::topics::kRobotStatus);
  wire::Writer<ObjectStates> played_states(player, wire::topics::kObjectStates);
  RobotClient robot(participant, {.start = kPatience});
  ObjectsClient objects(participant, robot, {.start = kPatience});
  ASSERT_TRUE(played_status.wait_for_readers(deadline()));
  ASSERT_TRUE(played_states.wait_for_readers(deadline()));
  const std::jthread speaker([&](std::stop_token stop) {
    soon(kPatience, [&] {
      (void)played_states.write(played_objects);
      return !played_status.write(played) || stop.stop_requested();
    });
  });
  const auto sim = program("jostle_sim", {easy});

  const auto robot_result = robot.read();
  const auto objects_result = objects.read();

  ASSERT_TRUE(robot_result) << robot_result.error().message;
  EXPECT_NE(robot_result->q.front(), 9.0);
  ASSERT_TRUE(objects_result) << objects_result.error().message;
  EXPECT_NE(objects_result->front().name, "played");
}

TEST_F(WorldLink, PusherSaysThatItCannotTellWhatIsInItsHand) {
  const auto scene = folder.write("push.yaml", physics_pool::to_yaml(push_ahead()));
  const auto sim = program("jostle_sim", {scene});
  RobotClient robot(participant, {.start = kPatience});
  const auto reading_result = robot.read();
  ASSERT_TRUE(reading_result) << reading_result.error().message << sim->err();
  EXPECT_EQ(reading_result->object_in_hand, std::nullopt);
}

// jostle_coordinator and a world, asked by hand.
class CoordinatorProcess : public WorldLink {
 protected:
  void SetUp() override {
    ASSERT_TRUE(goals.wait_for_readers(deadline())) << coordinator->err();
    ASSERT_TRUE(cancels.wait_for_readers(deadline())) << coordinator->err();
    ASSERT_TRUE(soon(kPatience, [&] { return results.matched() == 1; }));
  }

  Goal goal(const std::string& id) const {
    Goal goal;
    goal.goal_id(id);
    goal.execution_scene(contents(easy));
    goal.planning_scene(contents(easy));
    goal.parameters("control: {many_iterations: 1}\n");
    goal.controller("or");
    goal.plan_only(true);
    return goal;
  }

  GoalResult result_of(const std::string& id) {
    const auto end = deadline();
    while (auto result = results.take(end)) {
      if (result->goal_id() == id) return *result;
    }
    ADD_FAILURE() << "no result of " << id << "\n" << coordinator->err();
    return {};
  }

  const std::unique_ptr<ProgramProcess> sim = program("jostle_sim", {easy});
  const std::unique_ptr<ProgramProcess> coordinator =
      program("jostle_coordinator", {"--pool", "threads", "--threads", "1"});
  wire::Writer<Goal> goals{participant, wire::topics::kTaskGoal};
  wire::Writer<Cancel> cancels{participant, wire::topics::kTaskCancel};
  wire::Inbox<GoalResult> results{participant, wire::topics::kTaskResult, 64};
};

TEST_F(CoordinatorProcess, AnswersBadGoalsWithTheFieldAndGoesOnServing) {
  const std::pair<const char*, std::function<void(Goal&)>> cases[] = {
      {"goal.execution_scene", [](Goal& g) { g.execution_scene("\x01\xff garbage: ["); }},
      {"goal.execution_scene", [](Goal& g) { g.execution_scene(""); }},
      {"goal.planning_scene", [](Goal& g) { g.planning_scene("jostle_scene: 1\n"); }},
      {"goal.parameters", [](Goal& g) { g.parameters("planner: {rollouts: -3}\n"); }},
      {"goal.parameters", [](Goal& g) { g.parameters(std::string(1000, '[')); }},
      {"controller: got 'psychic'", [](Goal& g) { g.controller("psychic"); }}};
  int count = 0;
  for (const auto& [field, spoil] : cases) {
    Goal bad = goal(fmt::format("bad-{}", ++count));
    spoil(bad);
    EXPECT_TRUE(goals.write(bad));

    const GoalResult result = result_of(bad.goal_id());

    EXPECT_FALSE(result.success());
    EXPECT_EQ(result.ending(), GoalResult_Constants::INVALID);
    EXPECT_THAT(result.error(), HasSubstr(field));
    EXPECT_EQ(result.report(), "");
  }
  EXPECT_TRUE(goals.write(goal("good")));
  const GoalResult result = result_of("good");
  EXPECT_EQ(result.error(), "");
  EXPECT_TRUE(result.success()) << result.reason();
  EXPECT_EQ(result.ending(), GoalResult_Constants::SUCCEEDED);
}

TEST_F(CoordinatorProcess, BelievedWorldOfOtherObjectsIsAnErrorThatNamesThem) {
  Goal other = goal("other");
  physics_pool::Scene scene = three_objects();
  scene.objects[1].name = "teapot";
  other.planning_scene(physics_pool::to_yaml(scene));

  EXPECT_TRUE(goals.write(other));

  EXPECT_THAT(result_of("other").error(), HasSubstr("teapot"));
}

TEST_F(CoordinatorProcess, RefusesASecondGoalWhileBusyAndObeysCancel) {
  Goal endless_goal = goal("first");
  endless_goal.parameters(contents(endless));
  EXPECT_TRUE(goals.write(endless_goal));
  EXPECT_TRUE(goals.write(goal("second")));

  const GoalResult refusal = result_of("second");

  EXPECT_FALSE(refusal.success());
  EXPECT_EQ(refusal.ending(), GoalResult_Constants::REFUSED);
  EXPECT_THAT(refusal.error(), HasSubstr("busy with goal first"));

  Cancel cancel;
  cancel.goal_id("somebody else's");
  EXPECT_TRUE(cancels.write(cancel));
  cancel.goal_id("first");
  EXPECT_TRUE(cancels.write(cancel));
  EXPECT_EQ(result_of("first").ending(), GoalResult_Constants::CANCELLED);

  EXPECT_TRUE(goals.write(goal("third")));
  EXPECT_TRUE(result_of("third").success());
}

TEST_F(CoordinatorProcess, StampsItsFeedbackWithTheTimeOfTheWorld) {
  wire::Inbox<Feedback> feedback{participant, wire::topics::kTaskFeedback, 64};
  wire::Inbox<Observation> observations{participant, wire::topics::kTaskObservation, 64};
  Goal moving = goal("moving");
  moving.plan_only(false);

  EXPECT_TRUE(goals.write(moving));
  (void)result_of("moving");

  double seen = 0.0, told = -1.0;
  EXPECT_TRUE(soon(kPatience,
                   [&] {
                     for (const Observation& observation : observations.take_all())
                       seen = world::seconds(observation.header());
                     for (const Feedback& one : feedback.take_all()) told = world::seconds(one.header());
                     return seen > 0 && told == seen;
                   }))
      << "observed at " << seen << " s, told at " << told << " s";
}

// What viewers of ROS 2 need: one clock for all stamps, and no transform twice without need.
TEST_F(WorldLink, TheClockTellsTheTimeOfTheStampsAndTransformsDoNotRepeatThemselves) {
  wire::Inbox<rosgraph_msgs::msg::Clock> clock{participant, wire::topics::kClock, 512};
  wire::Inbox<sensor_msgs::msg::JointState> joints{participant, wire::topics::kJointStates, 512};
  wire::Inbox<tf2_msgs::msg::TFMessage> transforms{participant, wire::topics::kTransforms, 512};
  const auto sim = program("jostle_sim", {easy});
  RobotClient robot{participant};
  const std::vector<double> u(4, 0.0);
  ASSERT_TRUE(soon(kPatience, [&] { return robot.execute(u, 0.5, std::stop_token{}).has_value(); })) << sim->err();

  double told = 0.0, stamped = 0.0;
  std::size_t states = 0, standing = 0;
  ASSERT_TRUE(soon(kPatience, [&] {
    for (const auto& time : clock.take_all()) told = time.clock().sec() + 1e-9 * time.clock().nanosec();
    for (const auto& state : joints.take_all()) {
      stamped = world::seconds(state.header());
      if (stamped >= 0.5) ++states;
    }
    for (const auto& message : transforms.take_all()) {
      if (world::seconds(message.transforms().at(0).header()) >= 0.5) ++standing;
    }
    return states >= 10 && told >= 0.5;
  }));

  EXPECT_NEAR(told, 0.5, 1e-6);
  EXPECT_NEAR(stamped, 0.5, 1e-6);
  EXPECT_GE(standing, 1u);
  EXPECT_LT(standing, states / 2) << "of " << states << " states of a world that stands";
}

}  // namespace
}  // namespace jostle::tests
