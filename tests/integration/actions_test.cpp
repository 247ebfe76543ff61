// The coordinator's goals as ROS 2 actions, for clients as rmw_fastrtps makes them. integration.cyclone has those of
// rmw_cyclonedds.

#include <gmock/gmock.h>

#include "tests/support/action_client.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

namespace status = action_msgs::msg::GoalStatus_Constants;
namespace cancels = action_msgs::srv::CancelGoal_Response_Constants;
namespace endings = jostle_msgs::msg::GoalResult_Constants;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;
using Uuid = RosActionClient::Uuid;

constexpr Uuid kFirst{1, 2, 3}, kSecond{4, 5, 6}, kThird{7, 8, 9}, kFourth{10};

class Actions : public RunFixture {
 protected:
  void SetUp() override {
    coordinator = program("jostle_coordinator", {"--pool", "threads"});
    world = program("jostle_sim", {easy});
    ASSERT_TRUE(grasp.wait_for_server()) << coordinator->err();
  }

  // Only what must be said.
  jostle_msgs::msg::Goal goal(const std::string& parameters) const {
    jostle_msgs::msg::Goal goal;
    goal.execution_scene(contents(easy));
    goal.parameters(contents(parameters));
    goal.seed(1);
    return goal;
  }

  jostle_msgs::action::Manipulate_GetResult_Response result(RosActionClient& client, std::int64_t number) const {
    auto response = client.results.answer(number);
    if (!response) throw std::runtime_error("no result: " + coordinator->err());
    return *response;
  }

  RosNode node{domain};
  RosActionClient grasp{node, "/grasp"};
  std::unique_ptr<ProgramProcess> coordinator, world;
};

TEST_F(Actions, PerformAGoalAndTellHowItGoes) {
  ASSERT_TRUE(grasp.send(kFirst, goal(plain))) << coordinator->err();
  const std::int64_t asked = grasp.ask_for_result(kFirst);

  EXPECT_TRUE(grasp.wait_for_phase(kFirst, "acting")) << coordinator->err();
  const auto told = result(grasp, asked);

  EXPECT_EQ(told.status(), status::STATUS_SUCCEEDED) << told.result().result().error();
  EXPECT_TRUE(told.result().result().success());
  EXPECT_THAT(told.result().result().report(), StartsWith("{"));
  EXPECT_THAT(grasp.statuses_until(kFirst, status::STATUS_SUCCEEDED),
              ElementsAre(status::STATUS_ACCEPTED, status::STATUS_EXECUTING, status::STATUS_SUCCEEDED));
  // It is remembered, for who asks later and for the next one.
  EXPECT_EQ(result(grasp, grasp.ask_for_result(kFirst)).status(), status::STATUS_SUCCEEDED);
  EXPECT_FALSE(grasp.send(kFirst, goal(plain))) << "two goals of one id";
  EXPECT_EQ(grasp.cancel(kFirst), std::pair(int{cancels::ERROR_GOAL_TERMINATED}, std::size_t{0}));
}

TEST_F(Actions, CancelAGoalAndRejectASecondOneMeanwhile) {
  ASSERT_TRUE(grasp.send(kFirst, goal(endless))) << coordinator->err();
  const std::int64_t asked = grasp.ask_for_result(kFirst);
  ASSERT_TRUE(grasp.wait_for_phase(kFirst, "planning")) << coordinator->err();

  EXPECT_FALSE(grasp.send(kSecond, goal(plain)));
  EXPECT_EQ(grasp.cancel(kSecond), std::pair(int{cancels::ERROR_UNKNOWN_GOAL_ID}, std::size_t{0}));
  EXPECT_EQ(grasp.cancel(kFirst), std::pair(int{cancels::ERROR_NONE}, std::size_t{1}));

  const auto told = result(grasp, asked);
  EXPECT_EQ(told.status(), status::STATUS_CANCELED) << told.result().result().reason();
  EXPECT_EQ(told.result().result().ending(), endings::CANCELLED);
  EXPECT_THAT(grasp.statuses_until(kFirst, status::STATUS_CANCELED),
              ElementsAre(status::STATUS_ACCEPTED, status::STATUS_EXECUTING, status::STATUS_CANCELING,
                          status::STATUS_CANCELED));
  // All that there are, and all up to a time: of none that has ended.
  EXPECT_EQ(grasp.cancel({}), std::pair(int{cancels::ERROR_NONE}, std::size_t{0}));
  ASSERT_TRUE(soon(kPatience, [&] { return grasp.send(kThird, goal(endless)); })) << coordinator->err();
  EXPECT_EQ(grasp.cancel({}, 1), std::pair(int{cancels::ERROR_NONE}, std::size_t{0})) << "in 1970 there was none";
  EXPECT_EQ(grasp.cancel({}), std::pair(int{cancels::ERROR_NONE}, std::size_t{1}));
  EXPECT_EQ(result(grasp, grasp.ask_for_result(kThird)).status(), status::STATUS_CANCELED);
}

TEST_F(Actions, AbortWhatCannotBeDoneAndSayWhatIsWrongWithIt) {
  const auto wrong = [&](RosActionClient& client, const Uuid& id, const jostle_msgs::msg::Goal& asked) {
    EXPECT_TRUE(soon(kPatience, [&] { return client.send(id, asked); })) << coordinator->err();
    const auto told = result(client, client.ask_for_result(id));
    EXPECT_EQ(told.status(), status::STATUS_ABORTED);
    return told.result().result().error();
  };
  RosActionClient push(node, "/push");
  ASSERT_TRUE(push.wait_for_server());

  EXPECT_THAT(wrong(push, kFirst, goal(plain)), HasSubstr("got 'grasp', wanted 'push', or the action /grasp"));
  auto asked = goal(plain);
  asked.controller("nonsense");
  EXPECT_THAT(wrong(grasp, kFirst, asked), HasSubstr("goal.controller: got 'nonsense'"));
  asked = goal(plain);
  asked.parameters("planner: {rollouts: -1}\n");
  EXPECT_THAT(wrong(grasp, kSecond, asked), HasSubstr("goal.parameters"));
  asked = goal(plain);
  asked.execution_scene("[");
  EXPECT_THAT(wrong(grasp, kThird, asked), HasSubstr("goal.execution_scene"));
  physics_pool::Scene other = three_objects();
  other.objects.back().mass *= 2;
  asked = goal(plain);
  asked.execution_scene(physics_pool::to_yaml(other));
  EXPECT_THAT(wrong(grasp, kFourth, asked), HasSubstr("got a world simulated in the scene of hash"));
  const auto unknown = result(grasp, grasp.ask_for_result({}));
  EXPECT_EQ(unknown.status(), status::STATUS_UNKNOWN);
}

// Every client hears every answer, and two of them ask with the same numbers.
TEST_F(Actions, AnswerEachClientItsOwnRequests) {
  RosNode other_node(domain);
  RosActionClient other(other_node, "/grasp");
  ASSERT_TRUE(other.wait_for_server());
  ASSERT_TRUE(grasp.send(kFirst, goal(endless))) << coordinator->err();
  EXPECT_FALSE(other.send(kSecond, goal(plain)));
  const std::int64_t first = grasp.ask_for_result(kFirst), second = other.ask_for_result(kSecond);
  ASSERT_EQ(first, second);

  EXPECT_EQ(result(other, second).status(), status::STATUS_UNKNOWN);
  EXPECT_EQ(other.cancel(kFirst), std::pair(int{cancels::ERROR_NONE}, std::size_t{1}));
  EXPECT_EQ(result(grasp, first).status(), status::STATUS_CANCELED);
  EXPECT_GE(grasp.results.others, 1) << "the answer to the other one was heard, and told apart";
}

}  // namespace
}  // namespace jostle::tests
