// A robot's host and two hosts of workers, found in each of the three ways.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/support/hosts.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

constexpr int kRobot = 1, kFirst = 2, kSecond = 3;  // hosts

class SeveralHosts : public RunFixture {
 protected:
  std::unique_ptr<ProgramProcess> on(int host, const std::string& name, std::vector<std::string> arguments) {
    if (!discovery.empty()) arguments.insert(arguments.end(), {"--discovery", discovery});
    std::unique_ptr<ProgramProcess> process;
    hosts.on(host, [&] { process = program(name, arguments); });
    return process;
  }

  void start_workers() {
    for (const int host : {kFirst, kSecond}) {
      workers.push_back(on(host, "jostle_worker", {"--name", "host-" + std::to_string(host)}));
    }
  }

  // A search of a second or so.
  std::vector<std::string> planning(const std::string& name) {
    const std::string thorough = folder.write("thorough.yaml", "objective: {success_cost: 1.0e-9}\n"
                                                               "control: {many_iterations: 8}\n");
    return {easy, "--plan-only", "--headless", "--parameters", thorough, "--json", folder.path() / name};
  }

  json report(const std::string& name) const { return json::parse(contents(folder.path() / name)); }

  std::string plan_of_one_host() {
    auto arguments = planning("alone.json");
    arguments.insert(arguments.end(), {"--pool", "threads", "--workers", "2"});
    EXPECT_NE(finish(arguments), -1);
    return report("alone.json")["plan_hash"];
  }

  const Hosts hosts{3};
  std::string discovery;
  std::vector<std::unique_ptr<ProgramProcess>> workers;
};

class FoundBy : public SeveralHosts, public ::testing::WithParamInterface<std::string> {};

TEST_P(FoundBy, WorkersOfAllHostsMakeThePlanOfOne) {
  discovery = GetParam();
  std::unique_ptr<ProgramProcess> server;
  if (discovery.starts_with("server")) {
    hosts.on(kRobot, [&] { server = program("jostle_discovery_server", {}); });
  }
  start_workers();
  auto arguments = planning("together.json");
  arguments.insert(arguments.end(), {"--workers", "0"});

  run = on(kRobot, "jostle_run", arguments);
  ASSERT_TRUE(run->wait(kPatience)) << run->err();

  ASSERT_THAT(run->out(), HasSubstr("first plan")) << run->err();
  const json together = report("together.json");
  EXPECT_TRUE(together["used_workers"].contains("host-2")) << together["used_workers"];
  EXPECT_TRUE(together["used_workers"].contains("host-3")) << together["used_workers"];
  EXPECT_EQ(together["plan_hash"], plan_of_one_host());
}

INSTANTIATE_TEST_SUITE_P(, FoundBy,
                         ::testing::Values("multicast", "peers:10.77.0.1,10.77.0.2,10.77.0.3", "server:10.77.0.1"),
                         [](const auto& way) { return way.param.substr(0, way.param.find(':')); });

TEST_F(SeveralHosts, UnpluggedInMidPlanCostNoResultAndAreUsedAgainOnReturn) {
  start_workers();
  auto arguments = planning("unplugged.json");
  arguments.insert(arguments.end(), {"--workers", "0"});
  run = on(kRobot, "jostle_run", arguments);
  ASSERT_TRUE(searches()) << run->err();

  hosts.plug(kSecond, false);
  ASSERT_TRUE(run->wait(kPatience)) << run->err();
  ASSERT_THAT(run->out(), HasSubstr("first plan")) << run->err();

  hosts.plug(kSecond, true);
  const auto uses_the_second = [&] {
    auto again = planning("again.json");
    again.insert(again.end(), {"--workers", "0"});
    run = on(kRobot, "jostle_run", again);
    return run->wait(kPatience) && report("again.json")["used_workers"].contains("host-3");
  };
  EXPECT_TRUE(soon(kPatience, uses_the_second)) << run->err();
  EXPECT_EQ(report("again.json")["plan_hash"], report("unplugged.json")["plan_hash"]);
  EXPECT_EQ(report("unplugged.json")["plan_hash"], plan_of_one_host());
}

}  // namespace
}  // namespace jostle::tests
