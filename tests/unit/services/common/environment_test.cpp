#include "services/common/process/environment.hpp"

#include <gmock/gmock.h>

#include <cstdlib>
#include <map>

#include "tests/support/temp_folder.hpp"

namespace jostle::common {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// Of the variables that count only the test's are set.
class Environment : public testing::Test {
 protected:
  Environment() { clear(); }
  ~Environment() override { clear(); }

  static void clear() {
    for (const char* name : {"JOSTLE_DISCOVERY", "ROS_DISCOVERY_SERVER", "ROS_LOCALHOST_ONLY", "ROS_STATIC_PEERS",
                             "ROS_AUTOMATIC_DISCOVERY_RANGE", "ROS_SUPER_CLIENT", "FASTDDS_ENVIRONMENT_FILE"})
      unsetenv(name);
  }
  static void set(const char* name, const std::string& value) { setenv(name, value.c_str(), 1); }
  static NetworkChoice chosen() { return choose_network().value(); }

  static void expect_refused(const std::string& part) {
    const auto result = choose_network();
    ASSERT_FALSE(result) << part;
    EXPECT_EQ(result.error().code, Code::kInvalidArgument);
    EXPECT_THAT(result.error().message, HasSubstr(part));
  }
};

TEST_F(Environment, IsMulticastWhereItSaysNothing) {
  EXPECT_EQ(chosen().discovery, "multicast");
  EXPECT_THAT(chosen().origin, IsEmpty());
  EXPECT_TRUE(chosen().joins_group);
  EXPECT_THAT(network_news(chosen()), IsEmpty());
}

TEST_F(Environment, ServersOfRos2AreOurs) {
  set("ROS_DISCOVERY_SERVER", "10.0.0.1;;10.0.0.3:11899;");

  EXPECT_EQ(chosen().discovery, "server:10.0.0.1,,10.0.0.3:11899");
  EXPECT_FALSE(chosen().super_client);
  EXPECT_THAT(network_news(chosen()), ElementsAre(HasSubstr("ROS_DISCOVERY_SERVER=10.0.0.1;;10.0.0.3:11899; decides")));
  set("ROS_SUPER_CLIENT", "TRUE");
  EXPECT_TRUE(chosen().super_client);
  set("ROS_SUPER_CLIENT", "perhaps");
  expect_refused("ROS_SUPER_CLIENT: got 'perhaps', wanted 0, FALSE");
}

TEST_F(Environment, ServersMayStandInTheFileThatTheMiddlewareReads) {
  const tests::TempFolder folder;
  set("ROS_DISCOVERY_SERVER", "10.0.0.9");
  set("FASTDDS_ENVIRONMENT_FILE", folder.write("environment.json", R"({"environment_variables": {
    "ROS_DISCOVERY_SERVER": "10.0.0.1"}})"));
  EXPECT_EQ(chosen().discovery, "server:10.0.0.1");
  for (const char* text : {"", "{", "[]", "{\"environment_variables\": 7}"}) {
    set("FASTDDS_ENVIRONMENT_FILE", folder.write("environment.json", text));
    EXPECT_EQ(chosen().discovery, "server:10.0.0.9") << text;
  }
}

TEST_F(Environment, LocalhostOnlyKeepsEverythingHere) {
  set("ROS_LOCALHOST_ONLY", "1");

  EXPECT_EQ(chosen().discovery, "localhost");
  EXPECT_TRUE(chosen().only_this_machine);
  EXPECT_FALSE(chosen().joins_group);
  EXPECT_THAT(network_news(chosen()), ElementsAre(HasSubstr("nothing leaves this machine")));
  set("ROS_LOCALHOST_ONLY", "0");
  EXPECT_FALSE(chosen().only_this_machine);
  set("ROS_LOCALHOST_ONLY", "yes");
  expect_refused("ROS_LOCALHOST_ONLY: got 'yes', wanted 0 or 1");
}

TEST_F(Environment, RangesAndStaticPeersAreThoseOfRos2) {
  struct Case {
    const char *range, *peers, *discovery;
    bool joins_group;
  };
  for (const Case& one :
       {Case{"LOCALHOST", "", "peers:127.0.0.1", false},
        Case{"LOCALHOST", "10.0.0.2;10.0.0.3", "peers:10.0.0.2,10.0.0.3", false}, Case{"SUBNET", "", "multicast", true},
        Case{"SUBNET", "10.0.0.2; 10.0.0.3;", "multicast+peers:10.0.0.2,10.0.0.3", true},
        Case{"", "10.0.0.2", "multicast+peers:10.0.0.2", true}, Case{"SYSTEM_DEFAULT", "", "multicast", true},
        Case{"SYSTEM_DEFAULT", "10.0.0.2", "multicast", true}}) {
    set("ROS_AUTOMATIC_DISCOVERY_RANGE", one.range);
    set("ROS_STATIC_PEERS", one.peers);
    EXPECT_EQ(chosen().discovery, one.discovery) << one.range << " " << one.peers;
    EXPECT_EQ(chosen().joins_group, one.joins_group) << one.range << " " << one.peers;
    EXPECT_FALSE(chosen().only_this_machine);
  }
  EXPECT_THAT(chosen().overruled, ElementsAre("ROS_STATIC_PEERS=10.0.0.2"));
}

TEST_F(Environment, RangesThatLeaveJostleAloneOrAreNoneAreRefused) {
  set("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF");
  expect_refused("ROS_AUTOMATIC_DISCOVERY_RANGE: got 'OFF', wanted LOCALHOST, SUBNET");
  set("ROS_AUTOMATIC_DISCOVERY_RANGE", "localhost");
  expect_refused("got 'localhost', wanted SUBNET, LOCALHOST");
}

TEST_F(Environment, OurOwnVariableOverrulesAllOfRos2) {
  set("JOSTLE_DISCOVERY", "peers:10.0.0.2");
  set("ROS_DISCOVERY_SERVER", "10.0.0.1");
  set("ROS_LOCALHOST_ONLY", "1");
  set("ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF");

  EXPECT_EQ(chosen().discovery, "peers:10.0.0.2");
  EXPECT_FALSE(chosen().only_this_machine);
  EXPECT_THAT(chosen().overruled, ElementsAre("ROS_DISCOVERY_SERVER=10.0.0.1", "ROS_LOCALHOST_ONLY=1",
                                              "ROS_AUTOMATIC_DISCOVERY_RANGE=OFF"));
  EXPECT_THAT(network_news(chosen()),
              ElementsAre(HasSubstr("--discovery peers:10.0.0.2 is in force, and not ROS_DISCOVERY_SERVER=10.0.0.1")));
  set("JOSTLE_DISCOVERY", "localhost");
  EXPECT_TRUE(chosen().only_this_machine);
}

TEST_F(Environment, OfTwoOfRos2TheOneThatWinsThereWinsHere) {
  set("ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET");
  set("ROS_STATIC_PEERS", "10.0.0.2");
  set("ROS_LOCALHOST_ONLY", "1");
  EXPECT_EQ(chosen().discovery, "localhost");
  EXPECT_THAT(chosen().overruled, ElementsAre("ROS_STATIC_PEERS=10.0.0.2"));

  set("ROS_DISCOVERY_SERVER", "127.0.0.1");
  EXPECT_EQ(chosen().discovery, "server:127.0.0.1");
  EXPECT_TRUE(chosen().only_this_machine);
  set("ROS_DISCOVERY_SERVER", "10.0.0.1");
  expect_refused("ROS_DISCOVERY_SERVER: got '10.0.0.1', wanted one on this machine");
}

}  // namespace
}  // namespace jostle::common
