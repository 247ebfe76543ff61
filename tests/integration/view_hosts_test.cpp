// Who may look at a run, and cancel it, from another host.

#include <gmock/gmock.h>

#include "services/common/lab/hosts.hpp"
#include "tests/integration/view_client.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using common::Hosts;
using ::testing::HasSubstr;

constexpr int kRobot = 1, kOther = 2;  // hosts
constexpr std::uint16_t kPort = 8765;
const std::string kToken = "0123456789abcdef";

class ViewFromAnotherHost : public RunFixture {
 protected:
  void SetUp() override {
    auto hosts_result = Hosts::make(2);
    ASSERT_TRUE(hosts_result) << hosts_result.error().message;
    hosts = std::move(hosts_result).value();
    token_file = folder.write("token", kToken + "\n");
  }

  void show(std::vector<std::string> arguments) {
    hosts->on(kRobot, [&] { viewing = program("jostle_view", arguments); });
    ASSERT_TRUE(viewing->says("ready", kPatience)) << viewing->err();
  }

  // What the other host is answered.
  http::response<http::string_body> ask(const std::string& target, const Headers& headers) const {
    http::response<http::string_body> answer;
    hosts->on(kOther, [&] { answer = answer_of(kPort, target, headers, http::verb::get, robot); });
    return answer;
  }

  // How the robot's host is called there.
  Headers named(Headers more) const {
    more.insert({"Host", Hosts::address(kRobot) + ":" + std::to_string(kPort)});
    return more;
  }

  const boost::asio::ip::address robot = boost::asio::ip::make_address(Hosts::address(kRobot));
  std::unique_ptr<Hosts> hosts;
  std::string token_file;
  std::unique_ptr<ProgramProcess> viewing;
};

TEST_F(ViewFromAnotherHost, SeesNothingUnlessItIsLetIn) {
  ASSERT_NO_FATAL_FAILURE(show({}));
  EXPECT_THROW(ask("/", named({})), boost::system::system_error) << "nobody listens where others come";
}

TEST_F(ViewFromAnotherHost, TakesTheTokenAndNoForeignPage) {
  ASSERT_NO_FATAL_FAILURE(show({"--address", "0.0.0.0", "--token-file", token_file, "--control"}));

  EXPECT_EQ(ask("/", named(upgrade())).result_int(), 401);
  EXPECT_EQ(ask("/?token=0123456789abcdee", named(upgrade())).result_int(), 401);
  EXPECT_EQ(ask("/metrics", named({})).result_int(), 401);
  EXPECT_THAT(ask("/metrics", named({})).body(), HasSubstr("token: got none or another one"));
  EXPECT_EQ(ask("/metrics", named({{"Authorization", "Bearer " + kToken}})).result_int(), 200);
  EXPECT_EQ(ask("/?token=" + kToken, named(upgrade())).result_int(), 101);
  const std::string own = "http://" + Hosts::address(kRobot) + ":" + std::to_string(kPort);
  EXPECT_EQ(ask("/?token=" + kToken, named(upgrade({{"Origin", own}}))).result_int(), 101);
  // A browser there that has the token, and shows somebody else's page.
  for (const char* origin : {"https://elsewhere.example", "http://10.77.0.2:8765", "null"}) {
    EXPECT_EQ(ask("/?token=" + kToken, named(upgrade({{"Origin", origin}}))).result_int(), 403) << origin;
  }
}

TEST_F(ViewFromAnotherHost, CancelsWithTheToken) {
  ASSERT_NO_FATAL_FAILURE(show({"--address", "0.0.0.0", "--token-file", token_file, "--control"}));
  hosts->on(kRobot, [&] { start({easy, "--workers", "2", "--parameters", endless}); });
  ASSERT_TRUE(searches()) << run->err();

  hosts->on(kOther, [&] {
    ViewClient viewer(kPort, "/?token=" + kToken, robot);
    EXPECT_EQ(viewer.channel("/task/feedback")["schemaName"], "jostle_msgs/msg/Feedback");
    EXPECT_TRUE(soon(kPatience, [&] {
      viewer.send({{"op", "setParameters"}, {"parameters", {{{"name", "task.cancel"}, {"value", true}}}}, {"id", "1"}});
      const auto frame =
          viewer.next([](const auto& one) { return one.op() == "status" || one.op() == "parameterValues"; });
      return frame.op() == "parameterValues";
    }));
  });

  EXPECT_EQ(run->wait(kPatience), 130) << run->err();
}

}  // namespace
}  // namespace jostle::tests
