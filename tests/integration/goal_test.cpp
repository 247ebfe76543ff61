// jostle goal: a coordinator and a world that run already, as services of a machine do.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "services/task/run/goal_client.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class Goal : public RunFixture {
 protected:
  std::unique_ptr<ProgramProcess> start_coordinator() { return program("jostle_coordinator", {"--pool", "threads"}); }
  std::unique_ptr<ProgramProcess> start_world() { return program("jostle_sim", {easy}); }

  int ask(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), {easy, "--headless"});
    asked = program("jostle_goal", arguments);
    return asked->wait(kPatience).value_or(-1);
  }

  std::unique_ptr<ProgramProcess> asked;
};

TEST_F(Goal, IsReachedByWhoRunsAlreadyAndAgain) {
  const auto coordinator = start_coordinator();
  const auto world = start_world();
  const std::string file = folder.path() / "result.json";

  ASSERT_EQ(ask({"--wait", "60", "--json", file}), 0) << asked->err();

  EXPECT_THAT(asked->out(), HasSubstr("SUCCESS"));
  const json report = json::parse(contents(file), nullptr, false);
  EXPECT_EQ(report["success"], true);
  EXPECT_EQ(report["controller"], "or");
  EXPECT_FALSE(report.contains("pool")) << "nothing is known of the coordinator's";
  EXPECT_EQ(ask({"--wait", "60"}), 0) << "the target is still in the hand: " << asked->err();
  EXPECT_FALSE(coordinator->code()) << "a coordinator serves one goal after the other";
}

TEST_F(Goal, OfNobodySaysWhoIsMissingAndHowToStartIt) {
  EXPECT_EQ(ask({"--wait", "0.5"}), 3);
  EXPECT_THAT(asked->err(), HasSubstr("jostle coordinator"));

  const auto coordinator = start_coordinator();
  EXPECT_TRUE(soon(kPatience, [&] {
    EXPECT_EQ(ask({"--wait", "2"}), 3);
    return asked->err().find("jostle sim") != std::string::npos;
  })) << asked->err();
}

TEST_F(Goal, OfAnotherSceneThanTheWorldsIsNotSent) {
  const auto coordinator = start_coordinator();
  physics_pool::Scene other = three_objects();
  other.objects.back().mass *= 2;
  const auto world = program("jostle_sim", {folder.write("other.yaml", physics_pool::to_yaml(other))});

  EXPECT_EQ(ask({"--wait", "60"}), 2) << asked->out();

  EXPECT_THAT(asked->err(),
              AllOf(HasSubstr("got a world simulated in the scene of hash " + to_string(scene_hash(other))),
                    HasSubstr("wanted " + to_string(scene_hash(three_objects())))));
  EXPECT_THAT(coordinator->err(), Not(HasSubstr("goal ")));
}

TEST_F(Goal, IsPrintedAsAnActionsGoalAndSentToNobody) {
  ASSERT_EQ(ask({"--print-action", "--seed", "7"}), 0) << asked->err();

  const json goal = json::parse(asked->out(), nullptr, false)["goal"];
  EXPECT_EQ(physics_pool::parse_scene(goal["execution_scene"].get<std::string>(), "printed").value().task.kind,
            "grasp");
  EXPECT_EQ(goal["controller"], "or");
  EXPECT_EQ(goal["seed"], 7);
}

TEST_F(Goal, IsCancelledByCtrlC) {
  const auto coordinator = start_coordinator();
  const auto world = start_world();
  asked = program("jostle_goal", {easy, "--headless", "--wait", "60", "--parameters", endless});
  ASSERT_TRUE(asked->says("planning", kPatience)) << asked->err();

  asked->signal(SIGINT);

  EXPECT_EQ(asked->wait(kPatience), 130);
  EXPECT_THAT(asked->err(), HasSubstr("the task was cancelled"));
  EXPECT_FALSE(coordinator->code());
}

// A coordinator that says what a test lets it say, ten times a second, and never gives a result.
class MuteCoordinator {
 public:
  explicit MuteCoordinator(int domain) : participant_(wire::Participant::open({.domain = domain}).value()) {}

  void phase_of_each_goal(std::string phase) {
    speaker_ = std::jthread([this, phase = std::move(phase)](std::stop_token stop) {
      jostle_msgs::msg::Feedback feedback;
      feedback.phase("idle");
      while (!stop.stop_requested()) {
        if (const auto goal = goals_.take(std::chrono::steady_clock::now() + std::chrono::milliseconds(100), stop)) {
          feedback.goal_id(goal->goal_id());
          feedback.phase(phase);
        }
        (void)feedback_.write(feedback);
      }
    });
  }

 private:
  const wire::Participant participant_;
  wire::Writer<jostle_msgs::msg::Feedback> feedback_{participant_, wire::topics::kTaskFeedback};
  wire::Writer<jostle_msgs::msg::GoalResult> results_{participant_, wire::topics::kTaskResult};
  wire::Inbox<jostle_msgs::msg::Goal> goals_{participant_, wire::topics::kTaskGoal, 1};
  std::jthread speaker_;
};

TEST_F(Goal, WhoseResultIsLostEndsAfterAWhile) {
  MuteCoordinator coordinator(domain);
  coordinator.phase_of_each_goal("done");
  const auto world = start_world();

  EXPECT_EQ(ask({"--wait", "60"}), 3);

  EXPECT_THAT(asked->err(), HasSubstr("was done with the goal 10 s ago, and its result did not arrive"));
}

TEST_F(Goal, ThatIsWorkedOnIsWaitedFor) {
  MuteCoordinator coordinator(domain);
  coordinator.phase_of_each_goal("planning");
  const auto world = start_world();
  asked = program("jostle_goal", {easy, "--headless", "--wait", "60"});
  ASSERT_TRUE(asked->says("planning", kPatience)) << asked->err();

  EXPECT_FALSE(asked->wait(task::GoalClient::kIdlePatience + std::chrono::seconds(2))) << asked->err();
}

}  // namespace
}  // namespace jostle::tests
