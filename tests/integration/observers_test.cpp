// Whoever looks on (a recorder, `ros2 topic echo`) has readers of every topic and no part in
// the run: nothing is sent to it in the belief that it answers.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/world/link/world_client.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using namespace jostle_msgs::msg;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class Observers : public RunFixture {
 protected:
  nlohmann::json plan_of_a_run() {
    const std::string file = folder.path() / "result.json";
    EXPECT_EQ(finish({easy, "--workers", "1", "--parameters", plain, "--json", file}), 0) << run->err();
    return nlohmann::json::parse(contents(file), nullptr, false)["plan_hash"];
  }

  const wire::Participant participant = wire::Participant::open({.domain = domain}).value();
};

TEST_F(Observers, OfGoalsAndCommandsHearThemAndChangeNothing) {
  const auto alone = plan_of_a_run();
  wire::Inbox<Goal> goals(participant, wire::topics::kTaskGoal, 64);
  wire::Inbox<VelocityCommand> commands(participant, wire::topics::kRobotCommand, 64);
  const wire::Inbox<Feedback> feedback(participant, wire::topics::kTaskFeedback, 64);
  const wire::Inbox<GoalResult> results(participant, wire::topics::kTaskResult, 64);
  const wire::Inbox<RobotStatus> statuses(participant, wire::topics::kRobotStatus, 64);

  const auto watched = plan_of_a_run();

  EXPECT_EQ(watched, alone);
  EXPECT_EQ(goals.take_all().size(), 1u);
  EXPECT_GE(commands.take_all().size(), 1u);
}

// Its reader is found at once, the robot's much later.
TEST_F(Observers, AreNoRobotThatACommandCouldReach) {
  const wire::Inbox<VelocityCommand> observer(participant, wire::topics::kRobotCommand, 64);
  world::RobotClient sut(participant, {.silence = kPatience, .start = kPatience});
  const auto sim = program("jostle_sim", {easy});

  const auto executed = sut.execute(std::array{0.05, 0.0, 0.0, 0.0}, 0.2, {});

  EXPECT_TRUE(executed) << executed.error().message << sim->err();
}

// Statuses from one that reads no commands: a player, say.
TEST_F(Observers, WhoOnlySpeaksLikeARobotIsReported) {
  wire::Writer<RobotStatus> speaker(participant, wire::topics::kRobotStatus);
  world::RobotClient sut(participant, {.silence = kPatience, .start = 300ms});
  const std::jthread speaking(
      [&](std::stop_token stop) { soon(kPatience, [&] { return !speaker.write({}) || stop.stop_requested(); }); });

  const auto executed = sut.execute(std::array{0.05, 0.0, 0.0, 0.0}, 0.2, {});

  ASSERT_FALSE(executed);
  EXPECT_EQ(executed.error().code, Code::kUnavailable);
  EXPECT_THAT(executed.error().message, HasSubstr("does not read rt/robot/command"));
}

TEST_F(Observers, AnIdleCoordinatorIsNone) {
  const auto other = program("jostle_coordinator", {"--pool", "threads", "--threads", "1"});
  const wire::Writer<Goal> goals(participant, wire::topics::kTaskGoal);
  ASSERT_TRUE(goals.wait_for_readers(in(kPatience))) << other->err();

  start({easy, "--parameters", plain, "--workers", "1", "--plan-only"});

  EXPECT_EQ(run->wait(kPatience), 3) << run->err();
  EXPECT_THAT(run->err(), HasSubstr("ROS_DOMAIN_ID"));
  EXPECT_THAT(run->left_over(), IsEmpty());
}

}  // namespace
}  // namespace jostle::tests
