// A short `jostle bench chaos`, as a user starts it.

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>

#include "tests/support/program_process.hpp"
#include "tests/support/worker_process.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::HasSubstr;

class Chaos : public ::testing::Test {
 protected:
  std::optional<int> finish(std::vector<std::string> arguments) {
    arguments.insert(arguments.end(), {"--domain", std::to_string(test_domain())});
    sut = std::make_unique<ProgramProcess>("jostle_bench", arguments, folder,
                                           ProgramProcess::Environment{{"TMPDIR", folder.path()}});
    return sut->wait(180s);
  }

  const TempFolder folder;
  std::unique_ptr<ProgramProcess> sut;
};

TEST_F(Chaos, LeavesEveryPlanBitEqual) {
  const std::string file = folder.path() / "chaos.json";

  ASSERT_EQ(finish({"chaos", "--seed", "1", "--faults", "12", "--json", file}), 0) << sut->out() << sut->err();

  const json report = json::parse(contents(file));
  EXPECT_EQ(report["unequal"], 0);
  EXPECT_GE(report["plans"], 2);
  int faults = 0;
  for (const auto& [kind, count] : report["faults"].items()) faults += count.get<int>();
  EXPECT_EQ(faults, 12);
  EXPECT_THAT(sut->out(), HasSubstr("all bit-equal  yes"));
}

TEST_F(Chaos, SaysWhatHappenedUntilItWasInterrupted) {
  const std::string file = folder.path() / "chaos.json";
  sut = std::make_unique<ProgramProcess>("jostle_bench",
                                         std::vector<std::string>{"chaos", "--faults", "100000", "--json", file,
                                                                  "--domain", std::to_string(test_domain())},
                                         folder, ProgramProcess::Environment{{"TMPDIR", folder.path()}});
  const auto has_killed = [&] { return children_of(sut->pid()).size() >= 4; };
  ASSERT_TRUE(soon(120s, has_killed)) << sut->err();
  ASSERT_TRUE(sut->says("plans, the longest", 120s)) << sut->err();  // a line each half minute
  sut->signal(SIGINT);

  ASSERT_EQ(sut->wait(60s), 130) << sut->err();

  EXPECT_THAT(sut->err(), HasSubstr("jostle bench: interrupted"));
  EXPECT_THAT(sut->out(), HasSubstr("Partial: "));
  EXPECT_EQ(json::parse(contents(file))["partial"]["of"], 100000);
}

TEST_F(Chaos, HasItsOwnOptions) {
  EXPECT_EQ(finish({"chaos", "--workers", "2,3"}), 2);
  EXPECT_THAT(sut->err(), HasSubstr("--workers"));
}

}  // namespace
}  // namespace jostle::tests
