// jostle doctor between two hosts: when all is well it says so, and what is broken it names
// with the remedy.

#include <gmock/gmock.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <nlohmann/json.hpp>
#include <thread>

#include "services/common/lab/hosts.hpp"
#include "tests/support/program_process.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using common::Hosts;
using nlohmann::json;
using ::testing::AnyOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

constexpr std::chrono::seconds kPatience{60};
constexpr int kHere = 1, kThere = 2;

class Doctor : public ::testing::Test {
 protected:
  std::unique_ptr<ProgramProcess> on(int host, const std::string& name, const std::vector<std::string>& arguments) {
    std::unique_ptr<ProgramProcess> process;
    hosts->on(host, [&] { process = std::make_unique<ProgramProcess>(name, arguments, folder); });
    return process;
  }

  void listen(std::vector<std::string> more = {}) {
    more.insert(more.begin(), "--listen");
    listener = on(kThere, "jostle_doctor", more);
    ASSERT_TRUE(listener->says("listens at", kPatience)) << listener->err();
  }

  // What the doctor here says of that host; the exit code is `code`.
  void ask(std::vector<std::string> more = {}) {
    more.insert(more.begin(), {"--json", "--peer", Hosts::address(kThere)});
    const auto doctor = on(kHere, "jostle_doctor", more);
    code = doctor->wait(kPatience).value_or(-1);
    checks = json::parse(doctor->out(), nullptr, false);
    ASSERT_TRUE(checks.is_array()) << doctor->out() << doctor->err();
  }

  std::vector<std::string> failed() const {
    std::vector<std::string> names;
    for (const auto& check : checks) {
      if (check["verdict"] == "FAIL") names.push_back(check["name"]);
    }
    return names;
  }

  json check(const std::string& name) const {
    json found{{"verdict", "missing"}, {"finding", ""}, {"remedy", ""}};
    for (const auto& one : checks) {
      if (one["name"] == name) found = one;  // of two, the one about the pair
    }
    return found;
  }

  void expect_well() {
    EXPECT_EQ(code, 0) << checks.dump(2);
    EXPECT_THAT(failed(), IsEmpty()) << checks.dump(2);
    for (const char* name : {"peer", "version", "domain", "discovery", "identity", "clock", "UDP", "UDP fragments"}) {
      EXPECT_EQ(check(name)["verdict"], "ok") << check(name).dump(2);
    }
    for (const char* name : {"participants", "small samples", "samples of 1 MiB"}) {  // a busy machine may be slow
      EXPECT_THAT(check(name)["verdict"], AnyOf("ok", "warn")) << check(name).dump(2);
    }
  }

  // Names of failed checks, and words of the finding and the remedy of the first.
  void expect_failed(const std::vector<std::string>& names, const std::string& finding, const std::string& remedy) {
    EXPECT_EQ(code, 1);
    ASSERT_EQ(failed(), names) << checks.dump(2);
    EXPECT_THAT(check(names.front())["finding"].get<std::string>(), HasSubstr(finding));
    EXPECT_THAT(check(names.front())["remedy"].get<std::string>(), HasSubstr(remedy));
  }

  const std::unique_ptr<Hosts> hosts = [] {
    auto hosts_result = Hosts::make(2);
    if (!hosts_result) throw std::runtime_error(hosts_result.error().message);
    return std::move(hosts_result).value();
  }();
  const TempFolder folder;
  std::unique_ptr<ProgramProcess> listener;
  json checks;
  int code = -1;
};

TEST_F(Doctor, FindsNothingWrongByMulticast) {
  listen();
  ask();
  expect_well();
  EXPECT_EQ(check("multicast")["verdict"], "ok");
  EXPECT_EQ(check("10.77.0.2: worker")["verdict"], "ok") << "the other's own checks";
}

TEST_F(Doctor, WarnsOfADomainWhosePortsLinuxGivesToAnyProgram) {
  for (const auto& [domain, verdict] : {std::pair("100", "ok"), {"150", "warn"}}) {
    const auto doctor = on(kHere, "jostle_doctor", {"--json", "--domain", domain});
    doctor->wait(kPatience);
    checks = json::parse(doctor->out(), nullptr, false);
    EXPECT_EQ(check("domain")["verdict"], verdict) << doctor->out();
  }
  EXPECT_THAT(check("domain")["remedy"].get<std::string>(), HasSubstr("ROS_DOMAIN_ID below 101"));
}

TEST_F(Doctor, FindsNothingWrongByPeers) {
  const std::vector<std::string> way{"--discovery", "peers:10.77.0.1,10.77.0.2"};
  listen(way);
  ask(way);
  expect_well();
}

TEST_F(Doctor, FindsNothingWrongThroughAServer) {
  const auto server = on(kThere, "jostle_discovery_server", {});
  ASSERT_TRUE(server->says("listens at", kPatience)) << server->err();
  const std::vector<std::string> way{"--discovery", "server:10.77.0.2"};
  listen(way);
  ask(way);
  expect_well();
  EXPECT_EQ(check("discovery server")["verdict"], "ok");
}

TEST_F(Doctor, NamesACableThatIsOut) {
  listen();
  hosts->plug(kThere, false);
  ask();
  expect_failed({"peer"}, "10.77.0.2 (10.77.0.2), TCP port 11812: No route to host", "cables, addresses");
}

TEST_F(Doctor, NamesADoctorThatDoesNotListen) {
  ask();
  expect_failed({"peer"}, "Connection refused", "start `jostle doctor --listen` there");
}

TEST_F(Doctor, NamesADoorThatIsNoDoctors) {
  int door = -1;
  hosts->on(kThere, [&] {
    door = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in here{};
    here.sin_family = AF_INET;
    here.sin_port = htons(11812);
    ASSERT_EQ(bind(door, reinterpret_cast<const sockaddr*>(&here), sizeof here), 0);
    ASSERT_EQ(::listen(door, 1), 0);
  });
  const std::jthread stranger([door] {
    const int guest = accept(door, nullptr, nullptr);
    const std::string facts = "{\"host\":1}\n";
    send(guest, facts.data(), facts.size(), MSG_NOSIGNAL);
    char question[64];
    while (recv(guest, question, sizeof question, 0) > 0) continue;
    close(guest);
  });

  ask();

  shutdown(door, SHUT_RDWR);  // should nobody have come
  close(door);
  expect_failed({"peer"}, "facts of the other doctor", "of the same version");
}

TEST_F(Doctor, NamesBlockedMulticast) {
  for (const int host : {kHere, kThere}) {
    // Nobody there can join a group.
    hosts->on(host, [] { std::ofstream("/proc/sys/net/ipv4/igmp_max_memberships") << 0 << std::flush; });
  }
  listen();
  ask();
  EXPECT_EQ(code, 1);
  EXPECT_EQ(check("UDP")["verdict"], "ok");
  EXPECT_EQ(check("participants")["verdict"], "FAIL");
  ASSERT_EQ(check("multicast")["verdict"], "FAIL") << checks.dump(2);
  EXPECT_THAT(check("multicast")["remedy"].get<std::string>(),
              StartsWith("--discovery peers:10.77.0.1,10.77.0.2 on both"));
}

TEST_F(Doctor, NamesAWrongDomain) {
  listen({"--domain", "3"});
  ask({"--domain", "4"});
  expect_failed({"domain"}, "here 4, there 3", "ROS_DOMAIN_ID");
}

TEST_F(Doctor, NamesDifferentDiscovery) {
  listen();
  ask({"--discovery", "peers:10.77.0.1"});
  expect_failed({"discovery"}, "here peers:10.77.0.1, there multicast", "the same --discovery");
}

TEST_F(Doctor, NamesAHostThatIsNotListed) {
  listen({"--discovery", "peers:10.77.0.2"});
  ask({"--discovery", "peers:10.77.0.1"});
  expect_failed({"discovery", "participants"}, "peers:10.77.0.1 here does not list 10.77.0.2",
                "--discovery peers:10.77.0.1,10.77.0.2 on both");
}

TEST_F(Doctor, NamesAServerThatIsNotThere) {
  const std::vector<std::string> way{"--discovery", "server:10.77.0.2:7777"};
  listen(way);
  ask(way);
  expect_failed({"10.77.0.2: discovery server", "discovery server", "participants"},
                "10.77.0.2:7777: nobody listens there", "start `jostle discovery-server` on 10.77.0.2");
}

TEST_F(Doctor, KnowsIdentities) {
  const std::string keys = folder.path() / "keys", others = folder.path() / "others";
  for (const auto& keystore : {keys, others}) {
    ASSERT_EQ(on(kHere, "jostle_keys", {"init", keystore})->wait(kPatience), 0);
  }
  listen({"--secure", keys + "/identities/worker"});

  ask({"--secure", keys + "/identities/robot"});
  expect_well();
  EXPECT_THAT(check("identity")["finding"].get<std::string>(),
              HasSubstr("here robot (robot), there worker (worker), of one keystore"));

  ask({"--secure", others + "/identities/robot"});
  expect_failed({"identity", "participants"}, "of different keystores", "jostle keys issue");

  ask();
  expect_failed({"identity", "participants"}, "here none, there worker", "give both --secure, or neither");
}

TEST_F(Doctor, SurvivesWhateverComesToItsDoor) {
  listen();
  hosts->on(kHere, [] {
    // Lines that are no JSON, no question, of wrong types; then rubbish without an end.
    ASSERT_EQ(
        std::system("for text in rubbish '{}' '{\"ask\":7}' '{\"ask\":\"send\",\"port\":-1}' "
                    "'{\"ask\":\"heard\",\"text\":[],\"size\":-1}'; "
                    "do bash -c \"exec 3<>/dev/tcp/10.77.0.2/11812; echo '$text' >&3; exec 3>&-\"; done; "
                    "bash -c 'exec 3<>/dev/tcp/10.77.0.2/11812; head -c 1000000 /dev/zero >&3' 2>/dev/null; true"),
        0);
  });
  ask();
  expect_well();
}

}  // namespace
}  // namespace jostle::tests
