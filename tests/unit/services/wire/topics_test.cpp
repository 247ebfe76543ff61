#include <gmock/gmock.h>

#include <algorithm>
#include <fstream>
#include <regex>
#include <string>

#include "services/wire/dds/names.hpp"
#include "services/wire/dds/system_topics.hpp"

namespace jostle::tests {
namespace {

using ::testing::Optional;

TEST(Names, OfTopicsAndTypesGoBothWays) {
  EXPECT_EQ(wire::wire_topic("/robot/status"), "rt/robot/status");
  EXPECT_THAT(wire::ros_topic("rt/robot/status"), Optional(std::string("/robot/status")));
  EXPECT_THAT(wire::wire_type("jostle_msgs/msg/Goal"), Optional(std::string("jostle_msgs::msg::dds_::Goal_")));
  EXPECT_THAT(wire::ros_type("jostle_msgs::msg::dds_::Goal_"), Optional(std::string("jostle_msgs/msg/Goal")));
}

TEST(Names, OfOthersAreNone) {
  for (const char* topic : {"", "rt", "Square", "rq/serviceRequest", "ros_discovery_info"}) {
    EXPECT_EQ(wire::ros_topic(topic), std::nullopt) << topic;
  }
  for (const char* type : {"", "Goal", "jostle_msgs::msg::Goal", "jostle_msgs::srv::dds_::Add_Request_"}) {
    EXPECT_EQ(wire::ros_type(type), std::nullopt) << type;
  }
  EXPECT_EQ(wire::wire_type("jostle_msgs/srv/Add"), std::nullopt);
}

TEST(SystemTopics, AreAllThatTheHeadersDeclare) {
  static const std::regex declaration("^inline const Topic<.*>.* k\\w+\\{\"(.*)\", .*");
  std::vector<std::string> declared, listed;
  for (const char* file : {"topics.hpp", "display_topics.hpp"}) {
    std::ifstream header(std::string(JOSTLE_SOURCE_DIR "/services/wire/dds/") + file);
    for (std::string line; std::getline(header, line);) {
      std::smatch match;
      if (std::regex_match(line, match, declaration)) declared.push_back(match[1]);
    }
  }
  for (const auto& topic : wire::system_topics()) listed.push_back(topic.name);
  EXPECT_EQ(listed, declared);
}

TEST(SystemTopics, KnowTypePromiseAndKey) {
  const auto& topics = wire::system_topics();
  const auto world = std::ranges::find(topics, "rt/pool/world", &wire::SystemTopic::name);
  const auto goal = std::ranges::find(topics, "rt/task/goal", &wire::SystemTopic::name);
  ASSERT_TRUE(world != topics.end() && goal != topics.end());
  EXPECT_TRUE(world->keyed);
  EXPECT_FALSE(goal->keyed);
  EXPECT_EQ(goal->type, "jostle_msgs::msg::dds_::Goal_");
  EXPECT_EQ(goal->qos, kCommand);
}

}  // namespace
}  // namespace jostle::tests
