// Which topics are played, and as what.

#include <gmock/gmock.h>

#include "services/bags/play/topic_plan.hpp"
#include "tests/support/bags.hpp"

namespace jostle::tests {
namespace {

using bags::plan_topics;
using bags::TopicChoice;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

bags::BagInfo bag_of(const std::vector<bags::Topic>& topics) {
  bags::BagInfo info{.path = "shelf", .messages = 1};
  for (const bags::Topic& topic : topics) info.topics.push_back({.topic = topic, .messages = 1});
  return info;
}

bags::Topic typed(const std::string& name, const std::string& type, const Qos& qos = {}) {
  return {.name = name, .type = type, .qos = qos};
}

const bags::BagInfo kRun = bag_of(
    {typed("/joint_states", "sensor_msgs/msg/JointState", kState), typed("/lab/tf", "tf2_msgs/msg/TFMessage"),
     typed("/map", "nav_msgs/msg/OccupancyGrid", kLatched), typed("/notes", "std_msgs/msg/String"),
     typed("/play/status", "jostle_msgs/msg/PlayStatus", kLatched),
     typed("/pool/result", "jostle_msgs/msg/AssignmentResults"),
     typed("/robot/command", "jostle_msgs/msg/VelocityCommand", kCommand),
     typed("/robot/status", "jostle_msgs/msg/RobotStatus", kState),
     typed("/task/goal", "jostle_msgs/msg/Goal", kCommand), typed("/task/plan", "jostle_msgs/msg/Plan", kCommand)});

std::vector<std::string> names(const bags::TopicPlan& plan) {
  std::vector<std::string> result;
  for (const auto& topic : plan.played) result.push_back(topic.name + (topic.is_state ? " (state)" : ""));
  return result;
}

TEST(TopicPlan, PlaysAllButCommandsAndItsOwn) {
  const auto plan = taken(plan_topics(kRun, {}));
  EXPECT_THAT(names(plan), ElementsAre("/joint_states (state)", "/lab/tf (state)", "/map (state)", "/notes",
                                       "/robot/status (state)", "/task/plan"));
  EXPECT_THAT(plan.commands, ElementsAre("/pool/result", "/robot/command", "/task/goal"));
  EXPECT_THAT(plan.impossible, ElementsAre(HasSubstr("/play/status")));
  EXPECT_EQ(plan.played[4].wire.name, "rt/robot/status");
  EXPECT_EQ(plan.played[4].wire.type, "jostle_msgs::msg::dds_::RobotStatus_");
  EXPECT_EQ(plan.played[4].wire.qos, kState);
}

TEST(TopicPlan, CommandsNeedTheirFullName) {
  EXPECT_THAT(names(taken(plan_topics(kRun, {.selection = {.topics = {"/robot/*"}}}))),
              ElementsAre("/robot/status (state)"));
  EXPECT_THAT(names(taken(plan_topics(kRun, {.selection = {.topics = {"/robot/*", "/robot/command"}}}))),
              ElementsAre("/robot/command", "/robot/status (state)"));
  EXPECT_THAT(names(taken(plan_topics(
                  kRun, {.selection = {.topics = {"/robot/*"}}, .remaps = {{"/robot/command", "/recorded/command"}}}))),
              ElementsAre("/recorded/command", "/robot/status (state)"));
  const auto none = plan_topics(kRun, {.selection = {.topics = {"/robot/comm*"}}});
  ASSERT_FALSE(none);
  EXPECT_THAT(none.error().message,
              AllOf(HasSubstr("shelf: no topic to play"), HasSubstr("/robot/command commands somebody")));
}

TEST(TopicPlan, KnowsCommandsOfOthersByNameAndType) {
  EXPECT_TRUE(bags::commands_somebody(typed("/base/cmd_vel", "std_msgs/msg/String")));
  EXPECT_TRUE(bags::commands_somebody(typed("/arm/x", "trajectory_msgs/msg/JointTrajectory")));
  EXPECT_TRUE(bags::commands_somebody(typed("/x", "geometry_msgs/msg/TwistStamped")));
  EXPECT_TRUE(bags::commands_somebody(typed("/push/_action/feedback", "a_msgs/msg/B")));
  EXPECT_TRUE(bags::commands_somebody(typed("/left/robot/command", "x_msgs/msg/Y")));
  EXPECT_TRUE(bags::commands_somebody(typed("/left/task/goal", "x_msgs/msg/Y")));
  EXPECT_FALSE(bags::commands_somebody(typed("/commander/state", "std_msgs/msg/String")));
  EXPECT_FALSE(bags::commands_somebody(typed("/task/result", "jostle_msgs/msg/GoalResult")));
  EXPECT_FALSE(bags::commands_somebody(typed("/odom_twist", "geometry_msgs/msg/TwistWithCovarianceStamped")));
  EXPECT_FALSE(bags::commands_somebody(typed("/odom", "nav_msgs/msg/Odometry")));
}

TEST(TopicPlan, RemapsAndExcludes) {
  const auto plan = taken(plan_topics(kRun, {.selection = {.topics = {"/notes", "/joint*"}, .excluded = {"/j*"}},
                                             .remaps = {{"/notes", "/lab/notes"}}}));
  EXPECT_THAT(names(plan), ElementsAre("/lab/notes"));
  EXPECT_EQ(plan.played.front().wire.name, "rt/lab/notes");
  EXPECT_THAT(plan.commands, IsEmpty());
}

TEST(TopicPlan, RefusesWhatMakesNoSense) {
  const auto absent = plan_topics(kRun, {.remaps = {{"/nots", "/x"}}});
  ASSERT_FALSE(absent);
  EXPECT_THAT(absent.error().message, AllOf(HasSubstr("no topic /nots"), HasSubstr("/notes")));
  const auto clash = plan_topics(kRun, {.remaps = {{"/notes", "/map"}}});
  ASSERT_FALSE(clash);
  EXPECT_THAT(clash.error().message, HasSubstr("/map: got types"));
  const auto nothing = plan_topics(kRun, {.selection = {.topics = {"/nothing"}}});
  ASSERT_FALSE(nothing);
  EXPECT_THAT(nothing.error().message, AllOf(HasSubstr("it has /joint_states"), HasSubstr("/task/plan")));
}

TEST(TopicPlan, LeavesTheClockToTheClock) {
  const auto plan = taken(plan_topics(bag_of({typed("/clock", "rosgraph_msgs/msg/Clock"),
                                              typed("/n", "std_msgs/msg/String"), typed("/ros1", "std_msgs/String")}),
                                      {.with_clock = true}));
  EXPECT_THAT(names(plan), ElementsAre("/n", "/ros1"));
  EXPECT_THAT(plan.impossible, ElementsAre(HasSubstr("--clock")));
}

TEST(ParseRemap, WantsTwoTopics) {
  EXPECT_EQ(taken(bags::parse_remap("/a:=/b/c")), (std::pair<std::string, std::string>("/a", "/b/c")));
  for (const char* text : {"", "/a", "/a:=", ":=/b", "a:=/b", "/a=/b", "/a:=/b/"})
    EXPECT_FALSE(bags::parse_remap(text)) << text;
}

TEST(TopicPlan, KnowsNamesOfTheWireAndShortOnes) {
  const auto plan = taken(plan_topics(
      bag_of({typed("/short", "std_msgs/String"), typed("rt/dds", "std_msgs::msg::dds_::String_"),
              typed("rt/robot/command", "jostle_msgs::msg::dds_::VelocityCommand_"), typed("log", "foxglove.Log")}),
      {}));
  EXPECT_THAT(names(plan), ElementsAre("/short", "/dds"));
  EXPECT_EQ(plan.played[0].wire.type, "std_msgs::msg::dds_::String_");
  EXPECT_EQ(plan.played[1].wire.name, "rt/dds");
  EXPECT_THAT(plan.commands, ElementsAre("/robot/command"));
  EXPECT_THAT(plan.impossible, ElementsAre(HasSubstr("/log: its type foxglove.Log")));
}

TEST(TopicPlan, LeavesOutASecondTypeOfATopic) {
  const auto plan =
      taken(plan_topics(bag_of({typed("/x", "std_msgs/msg/String"), typed("/x", "std_msgs/msg/Int8")}), {}));
  EXPECT_THAT(names(plan), ElementsAre("/x"));
  EXPECT_THAT(plan.impossible, ElementsAre(HasSubstr("/x: got a second type std_msgs/msg/Int8")));
}

TEST(TopicPlan, LeavesOutWhatIsNotCdr) {
  auto topics = std::vector{typed("/x", "std_msgs/msg/String"), typed("/log", "std_msgs/msg/String")};
  topics[1].encoding = "json";
  const auto plan = taken(plan_topics(bag_of(topics), {}));
  EXPECT_THAT(names(plan), ElementsAre("/x"));
  EXPECT_THAT(plan.impossible, ElementsAre(HasSubstr("/log: its messages are encoded as 'json'")));
}

}  // namespace
}  // namespace jostle::tests
