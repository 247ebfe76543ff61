// What programs make of their environment on hosts of their own: ROS 2's variables, no IPv4, /dev/shm that is small,
// full or closed, servers and roles that are not what is needed.

#include <gmock/gmock.h>
#include <sys/mount.h>

#include <nlohmann/json.hpp>

#include "services/common/lab/hosts.hpp"
#include "tests/support/program_process.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using common::Hosts;
using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::chrono::seconds kPatience{60};
constexpr int kHere = 1, kThere = 2;
using Variables = ProgramProcess::Environment;

class Surroundings : public ::testing::Test {
 protected:
  std::unique_ptr<ProgramProcess> on(int host, const std::string& name, const std::vector<std::string>& arguments,
                                     Variables variables = {}) {
    std::unique_ptr<ProgramProcess> process;
    hosts->on(host, [&] { process = std::make_unique<ProgramProcess>(name, arguments, folder, variables); });
    return process;
  }

  // Replaces /dev/shm of the host.
  void mount_shared_memory(const std::string& options, unsigned long flags = 0) {
    hosts->on(kHere,
              [&] { ASSERT_EQ(mount("tmpfs", "/dev/shm", "tmpfs", flags, options.c_str()), 0) << strerror(errno); });
  }

  void command(int host, const std::string& text) {
    hosts->on(host, [&] { ASSERT_EQ(std::system(text.c_str()), 0) << text; });
  }

  json doctor(Variables variables = {}, std::vector<std::string> more = {}) {
    more.insert(more.begin(), "--json");
    const auto process = on(kHere, "jostle_doctor", more, variables);
    code = process->wait(kPatience).value_or(-1);
    const json checks = json::parse(process->out(), nullptr, false);
    EXPECT_TRUE(checks.is_array()) << process->out() << process->err();
    return checks;
  }

  static json check(const json& checks, const std::string& name) {
    json found{{"verdict", "missing"}, {"finding", ""}, {"remedy", ""}};
    for (const auto& one : checks) {
      if (one["name"] == name) found = one;
    }
    return found;
  }

  // Whether doctors of the two hosts find each other, each with its variables.
  bool meet(const Variables& here, const Variables& there) {
    const auto listener = on(kThere, "jostle_doctor", {"--listen"}, there);
    EXPECT_TRUE(listener->says("listens at", kPatience)) << listener->err();
    const json checks = doctor(here, {"--peer", Hosts::address(kThere)});
    EXPECT_NE(check(checks, "participants")["verdict"], "missing") << checks.dump(2);
    return check(checks, "participants")["verdict"] != "FAIL";
  }

  const std::unique_ptr<Hosts> hosts = [] {
    auto hosts_result = Hosts::make(2);
    if (!hosts_result) throw std::runtime_error(hosts_result.error().message);
    return std::move(hosts_result).value();
  }();
  const TempFolder folder;
  int code = -1;
};

// --- ROS 2 --------------------------------------------------------------------

TEST_F(Surroundings, LocalhostOnlyKeepsHostsApart) {
  const Variables only_here{{"ROS_LOCALHOST_ONLY", "1"}};
  EXPECT_FALSE(meet(only_here, only_here));
}

TEST_F(Surroundings, LocalhostOnlyOfOneSideIsEnough) { EXPECT_FALSE(meet({{"ROS_LOCALHOST_ONLY", "1"}}, {})); }

TEST_F(Surroundings, LocalhostOnlyLetsProcessesOfAHostMeet) {
  const Variables only_here{{"ROS_LOCALHOST_ONLY", "1"}};
  const auto listener = on(kHere, "jostle_doctor", {"--listen"}, only_here);
  ASSERT_TRUE(listener->says("listens at", kPatience)) << listener->err();
  const json checks = doctor(only_here, {"--peer", "127.0.0.1"});
  EXPECT_NE(check(checks, "samples of 1 MiB")["verdict"], "missing") << checks.dump(2);
  EXPECT_NE(check(checks, "samples of 1 MiB")["verdict"], "FAIL") << checks.dump(2);
}

TEST_F(Surroundings, LocalhostIsARangeWithoutOtherHosts) {
  const Variables near{{"ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"}};
  EXPECT_FALSE(meet(near, near));
}

TEST_F(Surroundings, LocalhostHearsNoMulticast) {
  EXPECT_FALSE(meet({{"ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"}}, {{"ROS_AUTOMATIC_DISCOVERY_RANGE", "SUBNET"}}));
}

TEST_F(Surroundings, StaticPeersOfOneSideAreFoundBeyondTheRange) {
  EXPECT_TRUE(meet({{"ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"}, {"ROS_STATIC_PEERS", Hosts::address(kThere)}},
                   {{"ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"}}));
}

TEST_F(Surroundings, StaticPeersComeBesideMulticast) { EXPECT_TRUE(meet({{"ROS_STATIC_PEERS", "10.77.0.99"}}, {})); }

TEST_F(Surroundings, ServerOfRos2IsTheOneThatIsAsked) {
  const auto server = on(kThere, "jostle_discovery_server", {"--port", "11899"});
  ASSERT_TRUE(server->says("listens at", kPatience)) << server->err();
  const Variables through{{"ROS_DISCOVERY_SERVER", Hosts::address(kThere) + ":11899"}};
  EXPECT_TRUE(meet(through, through));
}

TEST_F(Surroundings, ServerThatIsNotThereDoesNotDefeatAnotherChoice) {
  const Variables through{{"ROS_DISCOVERY_SERVER", "127.0.0.1:11899"}, {"JOSTLE_DISCOVERY", "multicast"}};
  EXPECT_TRUE(meet(through, through));
}

TEST_F(Surroundings, DoctorSaysWhatVariablesMean) {
  const json checks = doctor({{"ROS_DISCOVERY_SERVER", "127.0.0.1:11899"},
                              {"ROS_STATIC_PEERS", "10.77.0.2"},
                              {"JOSTLE_DISCOVRY", "multicast"},
                              {"RMW_IMPLEMENTATION", "rmw_cyclonedds_cpp"}});
  EXPECT_EQ(code, 1);
  EXPECT_THAT(check(checks, "discovery")["finding"].get<std::string>(),
              HasSubstr("server:127.0.0.1:11899, by ROS_DISCOVERY_SERVER"));
  EXPECT_EQ(check(checks, "ROS_DISCOVERY_SERVER")["verdict"], "ok");
  EXPECT_EQ(check(checks, "ROS_STATIC_PEERS")["verdict"], "warn");
  EXPECT_EQ(check(checks, "RMW_IMPLEMENTATION")["verdict"], "warn");
  EXPECT_THAT(check(checks, "JOSTLE_DISCOVRY")["remedy"].get<std::string>(), HasSubstr("JOSTLE_DISCOVERY"));
  EXPECT_EQ(check(checks, "discovery server")["verdict"], "FAIL");
}

TEST_F(Surroundings, MalformedVariablesAreNamedByProgramsAndDoctor) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {"ROS_DOMAIN_ID", "seven"},           {"ROS_DOMAIN_ID", "233"},
      {"ROS_LOCALHOST_ONLY", "yes"},        {"ROS_AUTOMATIC_DISCOVERY_RANGE", "OFF"},
      {"ROS_STATIC_PEERS", "no.such.host"}, {"ROS_DISCOVERY_SERVER", "127.0.0.1:x"},
      {"JOSTLE_DISCOVERY", "everywhere"},   {"JOSTLE_NAMESPACE", "9"},
      {"JOSTLE_DDS_TRANSPORT", "pigeons"},  {"JOSTLE_SECURE", "/nowhere"},
      {"JOSTLE_PROFILES", "/nowhere.xml"}};
  for (const auto& [name, value] : cases) {
    const auto worker = on(kHere, "jostle_worker", {}, {{name, value}});
    EXPECT_NE(worker->wait(kPatience).value_or(0), 0) << name;
    EXPECT_THAT(worker->err(), HasSubstr(value)) << name;
    doctor({{name, value}});
    EXPECT_EQ(code, 1) << name << "=" << value;
  }
}

// --- addresses ----------------------------------------------------------------

TEST_F(Surroundings, HostWithoutIpv4SaysSoAtOnce) {
  command(kHere, "ip -4 addr flush dev eth; ip -4 addr flush dev lo; ip -6 addr add fd77::1/64 dev eth");

  const auto worker = on(kHere, "jostle_worker", {});

  EXPECT_NE(worker->wait(kPatience).value_or(0), 0);
  EXPECT_THAT(worker->err(), HasSubstr("no IPv4 address"));
  EXPECT_EQ(check(doctor(), "IPv4")["verdict"], "FAIL");
}

TEST_F(Surroundings, HostWithNothingButLoopbackWorksAlone) {
  command(kHere, "ip link set eth down");
  const json checks = doctor();
  EXPECT_EQ(check(checks, "IPv4")["verdict"], "warn") << checks.dump(2);
  EXPECT_EQ(check(checks, "participant")["verdict"], "ok") << checks.dump(2);
}

// --- shared memory ------------------------------------------------------------

class SharedMemory : public Surroundings {
 protected:
  const Variables shared{{"JOSTLE_DDS_TRANSPORT", "shared_memory"}};

  // Starts so many workers; returns how many have no shared memory. All must live.
  int without(int count) {
    std::vector<std::unique_ptr<ProgramProcess>> workers;
    int warned = 0;
    for (int i = 0; i < count; ++i) {
      workers.push_back(on(kHere, "jostle_worker", {}, shared));
      EXPECT_TRUE(workers.back()->says("rollouts at a time", kPatience)) << workers.back()->err();
    }
    for (const auto& worker : workers) {
      EXPECT_FALSE(worker->code()) << worker->err();
      if (worker->err().find("no shared memory, UDP instead: /dev/shm") != std::string::npos) ++warned;
    }
    return warned;
  }
};

TEST_F(SharedMemory, IsUsedWhereThereIsRoom) { EXPECT_EQ(without(2), 0); }

TEST_F(SharedMemory, IsLeftOutWhereItIsTooSmall) {
  mount_shared_memory("size=512k");
  EXPECT_EQ(without(2), 2);
}

TEST_F(SharedMemory, IsForAsManyAsItHasRoomFor) {
  mount_shared_memory("size=20m");
  EXPECT_EQ(without(4), 2);  // 9 MiB each
}

TEST_F(SharedMemory, ThatSomebodyFillsLaterStillCarriesSamples) {
  mount_shared_memory("size=30m");
  const auto listener = on(kHere, "jostle_doctor", {"--listen"}, shared);
  ASSERT_TRUE(listener->says("listens at", kPatience)) << listener->err();
  // All but the room of one more participant and a half.
  command(kHere, "head -c 6M /dev/zero >/dev/shm/other");

  const json checks = doctor(shared, {"--peer", "127.0.0.1"});

  EXPECT_EQ(code, 0) << checks.dump(2);
  EXPECT_FALSE(listener->code()) << listener->err();
}

TEST_F(SharedMemory, IsLeftOutWhereNobodyMayWrite) {
  mount_shared_memory("size=64m", MS_RDONLY);
  EXPECT_EQ(without(1), 1);
  EXPECT_EQ(check(doctor(), "shared memory")["verdict"], "warn");
}

// --- servers and roles --------------------------------------------------------

TEST_F(Surroundings, ServerThatIsNotThereIsSaidWithinSeconds) {
  const std::string scene = folder.path() / "scene.yaml";
  ASSERT_EQ(on(kHere, "jostle_scene", {"generate", "--objects", "2", "-o", scene})->wait(kPatience), 0);
  const auto run = on(kHere, "jostle_run", {scene, "--discovery", "server:127.0.0.1:11899"});
  EXPECT_EQ(run->wait(kPatience), 3);
  EXPECT_THAT(run->err(), HasSubstr("no discovery server answered at 127.0.0.1:11899"));

  const auto worker = on(kHere, "jostle_worker", {"--discovery", "server:127.0.0.1:11899"});
  EXPECT_TRUE(worker->says("no discovery server answered at 127.0.0.1:11899", kPatience));
  EXPECT_TRUE(worker->says("rollouts at a time", kPatience)) << "a worker waits for it";

  EXPECT_EQ(check(doctor({}, {"--discovery", "server:127.0.0.1:11899"}), "discovery server")["verdict"], "FAIL");
}

TEST_F(Surroundings, RoleThatIsNotEnoughIsExplainedBeforeAnythingElse) {
  const std::string keys = folder.path() / "keys";
  ASSERT_EQ(on(kHere, "jostle_keys", {"init", keys})->wait(kPatience), 0);

  const std::string scene = folder.path() / "scene.yaml";
  ASSERT_EQ(on(kHere, "jostle_scene", {"generate", "--objects", "2", "-o", scene})->wait(kPatience), 0);
  const auto sut = on(kHere, "jostle_run", {scene, "--secure", keys + "/identities/worker"});

  EXPECT_EQ(sut->wait(kPatience), 2);
  EXPECT_THAT(sut->err(), HasSubstr("identity 'worker' has role worker, `jostle run` needs robot"));
  EXPECT_THAT(sut->err() + sut->out(), Not(HasSubstr("\033[")));
}

TEST_F(Surroundings, ProtectedAndUnprotectedOnesAreToldOfEachOther) {
  const std::string keys = folder.path() / "keys";
  ASSERT_EQ(on(kHere, "jostle_keys", {"init", keys})->wait(kPatience), 0);
  const auto worker = on(kHere, "jostle_worker", {});
  ASSERT_TRUE(worker->says("rollouts at a time", kPatience)) << worker->err();

  const auto protected_one = check(doctor({}, {"--secure", keys + "/identities/robot"}), "participant");
  EXPECT_EQ(protected_one["verdict"], "warn");
  EXPECT_THAT(protected_one["finding"].get<std::string>(), HasSubstr("is unprotected and this program is protected"));

  const auto guarded = on(kHere, "jostle_worker", {"--secure", keys + "/identities/worker"});
  ASSERT_TRUE(guarded->says("rollouts at a time", kPatience)) << guarded->err();
  const auto unprotected_one = check(doctor(), "participant");
  EXPECT_THAT(unprotected_one["finding"].get<std::string>(), HasSubstr("is protected and this program is unprotected"));
}

}  // namespace
}  // namespace jostle::tests
