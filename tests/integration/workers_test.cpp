// Who is there: `jostle workers`, and what a worker says of its clients.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/support/run_fixture.hpp"

namespace jostle::tests {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

class Workers : public RunFixture {
 protected:
  std::unique_ptr<ProgramProcess> start_worker(const std::vector<std::string>& arguments) {
    auto worker = program("jostle_worker", arguments);
    EXPECT_TRUE(worker->says("rollouts at a time", kPatience)) << worker->err();
    return worker;
  }

  // What the tool says in the end, once it is true: discovery takes its time on a busy machine.
  json list_until(const std::function<bool(const json&)>& fits) {
    json list;
    soon(kPatience, [&] {
      const auto tool = program("jostle_workers", {"--json", "--seconds", "1"});
      tool->wait(kPatience);
      list = json::parse(tool->out(), nullptr, false);
      return list.is_array() && fits(list);
    });
    return list;
  }
};

TEST_F(Workers, AreListedWithWhatTheyAre) {
  const auto one = start_worker({"--threads", "2", "--name", "one"}), other = start_worker({});

  const json list = list_until([](const json& workers) { return workers.size() == 2; });

  ASSERT_EQ(list.size(), 2u) << list.dump(2);
  for (const json& worker : list) {
    const bool is_one = worker["name"] == "one";
    EXPECT_EQ(worker["pid"], is_one ? one->pid() : other->pid());
    EXPECT_EQ(worker["threads"], is_one ? 2 : 1);
    const std::string own = fmt::format("{}-{}", worker["host"].get<std::string>(), worker["pid"].get<pid_t>());
    EXPECT_EQ(worker["name"], is_one ? "one" : own);
    EXPECT_EQ(worker["busy"], 0);
    EXPECT_GE(worker["host_load"], 0.0);
    EXPECT_THAT(worker["version"].get<std::string>(), HasSubstr("Jostle "));
    EXPECT_TRUE(worker["clients"].empty());
    EXPECT_THAT(worker["id"].get<std::string>(), MatchesRegex("[0-9a-f]{16}"));
  }
}

TEST_F(Workers, SayWhomTheyServe) {
  const auto worker = start_worker({"--name", "one"});
  start({easy, "--workers", "0", "--parameters", endless});
  ASSERT_TRUE(searches()) << run->err();

  const json list = list_until([](const json& workers) { return !workers.empty() && !workers[0]["clients"].empty(); });

  ASSERT_FALSE(list.empty());
  ASSERT_FALSE(list[0]["clients"].empty()) << list.dump(2);
  const pid_t coordinator = run->child("jostle_coordinator");
  EXPECT_THAT(list[0]["clients"][0]["who"].get<std::string>(), HasSubstr("jostle_coordinator on "));
  EXPECT_THAT(list[0]["clients"][0]["who"].get<std::string>(), HasSubstr(fmt::format("process {}", coordinator)));
  EXPECT_GT(list[0]["clients"][0]["samples"], 0);
  EXPECT_TRUE(worker->says("one: serves client", kPatience)) << worker->err();
  run->signal(SIGINT);
  EXPECT_EQ(run->wait(kPatience), 130);
  EXPECT_TRUE(worker->says("one: served client", kPatience)) << worker->err();
  EXPECT_THAT(worker->err(), HasSubstr(fmt::format("process {}): ", coordinator)));
}

TEST_F(Workers, AreATableForPeople) {
  const auto worker = start_worker({"--name", "one"});
  std::unique_ptr<ProgramProcess> tool;
  EXPECT_TRUE(soon(kPatience, [&] {
    tool = program("jostle_workers", {"--seconds", "1"});
    return tool->wait(kPatience) == 0;
  })) << tool->err();
  EXPECT_THAT(tool->out(), HasSubstr("name"));
  EXPECT_THAT(tool->out(), HasSubstr("serving"));
  EXPECT_THAT(tool->out(), HasSubstr("0/1"));
}

TEST_F(Workers, ThatAreNotThereAreExitCodeOneAndARemedy) {
  const auto tool = program("jostle_workers", {"--seconds", "0.2"});
  EXPECT_EQ(tool->wait(kPatience), 1);
  EXPECT_THAT(tool->err(), HasSubstr("start one with `jostle worker`"));
  const auto wrong = program("jostle_workers", {"--seconds", "never"});
  EXPECT_EQ(wrong->wait(kPatience), 2);
}

TEST_F(Workers, AreWatchedUntilInterrupted) {
  const auto tool = program("jostle_workers", {"--seconds", "0.1", "--watch", "--json"});
  EXPECT_TRUE(soon(kPatience, [&] { return std::ranges::count(tool->out(), '\n') >= 2; })) << tool->err();
  tool->signal(SIGINT);
  EXPECT_EQ(tool->wait(kPatience), 130);
}

// As the workers of two runs in one domain may have.
TEST_F(Workers, OfOneNameAreToldApartAndCountedRight) {
  const auto one = start_worker({"--name", "twin"}), other = start_worker({"--name", "twin"});
  const std::string result = folder.path() / "result.json";
  ASSERT_EQ(finish({easy, "--workers", "0", "--parameters", plain, "--json", result}), 0) << run->err();
  const json report = json::parse(contents(result));
  std::uint64_t sum = 0;
  for (const auto& [name, rollouts] : report["used_workers"].items()) {
    EXPECT_THAT(name, MatchesRegex("twin( \\(.*:[0-9]+\\))?"));
    sum += rollouts.get<std::uint64_t>();
  }
  EXPECT_EQ(sum, report["rollouts"].get<std::uint64_t>());
  EXPECT_THAT(run->err(), ::testing::Not(HasSubstr(":-")));
}

}  // namespace
}  // namespace jostle::tests
