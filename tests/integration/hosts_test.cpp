// A robot's host and two hosts of workers, found in each of the three ways, over good cables and bad ones.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "services/common/lab/hosts.hpp"
#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using common::Hosts;
using common::LinkQuality;
using nlohmann::json;
using ::testing::HasSubstr;

constexpr int kRobot = 1, kFirst = 2, kSecond = 3;  // hosts

// Round trips of 10 ms, of which one in fifty takes a repetition.
constexpr LinkQuality kBadCables{.delay = std::chrono::milliseconds(5), .loss = 0.01, .seed = 5};

class SeveralHosts : public RunFixture {
 protected:
  void connect(const LinkQuality& quality = {}) {
    auto hosts_result = Hosts::make(3, quality);
    if (!hosts_result) throw std::runtime_error(hosts_result.error().message);
    hosts = std::move(hosts_result).value();
  }

  std::unique_ptr<ProgramProcess> on(int host, const std::string& name, std::vector<std::string> arguments) {
    if (!discovery.empty()) arguments.insert(arguments.end(), {"--discovery", discovery});
    std::unique_ptr<ProgramProcess> process;
    hosts->on(host, [&] { process = program(name, arguments); });
    return process;
  }

  void start_workers() {
    for (const int host : {kFirst, kSecond}) {
      workers.push_back(on(host, "jostle_worker", {"--name", "host-" + std::to_string(host)}));
    }
  }

  // A search of so many iterations, a tenth of a second or two each.
  std::vector<std::string> planning(const std::string& name, int iterations) {
    const std::string thorough = folder.write(
        "thorough.yaml",
        fmt::format("objective: {{success_cost: 1.0e-9}}\ncontrol: {{many_iterations: {}}}\n", iterations));
    return {easy, "--plan-only", "--headless", "--parameters", thorough, "--json", folder.path() / name};
  }

  json report(const std::string& name) const { return json::parse(contents(folder.path() / name)); }

  // The same for every test; made once.
  std::string plan_of_one_host(int iterations) {
    static std::map<int, std::string> plans;
    if (plans.contains(iterations)) return plans[iterations];
    auto arguments = planning("alone.json", iterations);
    arguments.insert(arguments.end(), {"--pool", "threads", "--workers", "2"});
    EXPECT_NE(finish(arguments), -1);
    return plans[iterations] = report("alone.json")["plan_hash"];
  }

  // The run on the robot's host, with the workers that are there.
  void start_plan(int iterations) {
    auto arguments = planning("together.json", iterations);
    arguments.insert(arguments.end(), {"--workers", "0"});
    run = on(kRobot, "jostle_run", arguments);
  }

  // Waits until the newest iteration shown is this one or a later one.
  bool reaches(int iteration) const {
    const auto newest = [&] {
      static const std::regex shown("planning +iteration +([0-9]+)");
      const std::string text = run->err();
      int last = 0;
      for (std::sregex_iterator match(text.begin(), text.end(), shown), end; match != end; ++match) {
        last = std::stoi((*match)[1]);
      }
      return last;
    };
    return soon(kPatience, [&] { return newest() >= iteration || run->code(); }) && !run->code();
  }

  std::unique_ptr<Hosts> hosts;
  std::string discovery;
  std::vector<std::unique_ptr<ProgramProcess>> workers;
};

struct Meeting {
  std::string discovery;
  LinkQuality quality;
};

class FoundBy : public SeveralHosts, public ::testing::WithParamInterface<Meeting> {};

TEST_P(FoundBy, WorkersOfAllHostsMakeThePlanOfOne) {
  constexpr int kIterations = 8;
  connect(GetParam().quality);
  discovery = GetParam().discovery;
  std::unique_ptr<ProgramProcess> server;
  if (discovery.starts_with("server")) {
    hosts->on(kRobot, [&] { server = program("jostle_discovery_server", {}); });
  }
  start_workers();

  start_plan(kIterations);
  ASSERT_TRUE(run->wait(kPatience)) << run->err();

  ASSERT_THAT(run->out(), HasSubstr("first plan")) << run->err();
  const json together = report("together.json");
  EXPECT_TRUE(together["used_workers"].contains("host-2")) << together["used_workers"];
  EXPECT_TRUE(together["used_workers"].contains("host-3")) << together["used_workers"];
  EXPECT_EQ(together["plan_hash"], plan_of_one_host(kIterations));
  EXPECT_EQ(hosts->counts().lost > 0, !GetParam().quality.perfect());
}

std::vector<Meeting> meetings() {
  std::vector<Meeting> all;
  for (const LinkQuality& quality : {LinkQuality{}, kBadCables}) {
    for (const char* way : {"multicast", "peers:10.77.0.1,10.77.0.2,10.77.0.3", "server:10.77.0.1"}) {
      all.push_back({way, quality});
    }
  }
  return all;
}

INSTANTIATE_TEST_SUITE_P(, FoundBy, ::testing::ValuesIn(meetings()), [](const auto& meeting) {
  return fmt::format("{}Over{}Cables", meeting.param.discovery.substr(0, meeting.param.discovery.find(':')),
                     meeting.param.quality.perfect() ? "Good" : "Bad");
});

class Unplugged : public SeveralHosts, public ::testing::WithParamInterface<LinkQuality> {};

// Once the other cable is out, only the one that came back can bring the plan to its end.
TEST_P(Unplugged, HostCostsNoResultAndIsUsedAgainInTheSamePlanWhenItReturns) {
  constexpr int kIterations = 14;
  connect(GetParam());
  start_workers();
  start_plan(kIterations);
  ASSERT_TRUE(reaches(1)) << run->err();

  hosts->plug(kSecond, false);
  ASSERT_TRUE(reaches(3)) << run->err();
  hosts->plug(kSecond, true);
  hosts->plug(kFirst, false);
  ASSERT_FALSE(run->code()) << run->err();
  ASSERT_TRUE(run->wait(kPatience)) << run->err();

  ASSERT_THAT(run->out(), HasSubstr("first plan")) << run->err();
  EXPECT_EQ(report("together.json")["plan_hash"], plan_of_one_host(kIterations));
}

INSTANTIATE_TEST_SUITE_P(, Unplugged, ::testing::Values(LinkQuality{}, kBadCables), [](const auto& quality) {
  return quality.param.perfect() ? "OverGoodCables" : "OverBadCables";
});

// As at boot, when programs are often faster than the network.
TEST_F(SeveralHosts, WorkerThatStartedWithoutANetworkIsUsedOnceThereIsOne) {
  constexpr int kIterations = 8;
  connect();
  hosts->plug(kSecond, false);
  start_workers();
  ASSERT_TRUE(workers.back()->says("rollouts at a time", kPatience)) << workers.back()->err();

  hosts->plug(kSecond, true);
  ASSERT_TRUE(workers.back()->says("joins again", kPatience)) << workers.back()->err();
  hosts->plug(kFirst, false);
  start_plan(kIterations);
  ASSERT_TRUE(run->wait(kPatience)) << run->err();

  ASSERT_THAT(run->out(), HasSubstr("first plan")) << run->err();
  EXPECT_TRUE(report("together.json")["used_workers"].contains("host-3"));
  EXPECT_EQ(report("together.json")["plan_hash"], plan_of_one_host(kIterations));
}

}  // namespace
}  // namespace jostle::tests
