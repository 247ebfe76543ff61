// `jostle experiment` and `jostle bench` as a user starts, interrupts and resumes them.

#include <gmock/gmock.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tests/support/program_process.hpp"
#include "tests/support/terminal_process.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr auto kPatience = 300s;

class Studies : public ::testing::Test {
 protected:
  std::optional<int> finish(const std::string& program, const std::vector<std::string>& arguments) {
    start(program, arguments);
    return sut->wait(kPatience);
  }
  void start(const std::string& program, const std::vector<std::string>& arguments) {
    sut = std::make_unique<ProgramProcess>(program, arguments, folder,
                                           ProgramProcess::Environment{{"TMPDIR", folder.path()}});
  }
  // 12 predictions, one after the other.
  void start_study(std::vector<std::string> more = {}) {
    std::vector<std::string> arguments{"table-6.1", "--samples", "2", "--jobs", "1", "--json", file};
    arguments.insert(arguments.end(), more.begin(), more.end());
    start("jostle_experiment", arguments);
  }
  std::size_t kept() const {
    const std::string text = contents(file + ".journal");
    const auto lines = std::ranges::count(text, '\n');
    return lines > 0 ? static_cast<std::size_t>(lines) - 1 : 0;  // but for the origin
  }

  const TempFolder folder;
  const std::string file = folder.path() / "x.json";
  std::unique_ptr<ProgramProcess> sut;
};

TEST_F(Studies, AnInterruptedOneSaysWhatItHasAndGoesOn) {
  start_study();
  ASSERT_TRUE(soon(kPatience, [&] { return kept() >= 2; })) << sut->err();
  sut->signal(SIGINT);
  ASSERT_EQ(sut->wait(kPatience), 130) << sut->err();
  EXPECT_THAT(sut->err(), AllOf(HasSubstr("interrupted after"), HasSubstr("the same command goes on"),
                                Not(HasSubstr("cancelled by its caller"))));
  EXPECT_THAT(sut->out(), AllOf(HasSubstr("Partial: "), HasSubstr("kinematic")));
  const json partial = json::parse(contents(file));
  EXPECT_EQ(partial["partial"]["of"], 12);
  const std::size_t before = kept();
  EXPECT_EQ(partial["partial"]["done"], before);

  // Killed, it loses the run under way at most.
  start_study();
  ASSERT_TRUE(sut->says("runs are taken from", kPatience)) << sut->err();
  ASSERT_TRUE(soon(kPatience, [&] { return kept() > before; })) << sut->err();
  sut->signal(SIGKILL);
  (void)sut->wait(kPatience);
  const std::size_t killed = kept();
  EXPECT_GT(killed, before);

  // What it depends on has changed.
  start("jostle_experiment", {"table-6.1", "--samples", "3", "--jobs", "1", "--json", file});
  EXPECT_EQ(sut->wait(kPatience), 2);
  EXPECT_THAT(sut->err(), AllOf(HasSubstr("settings.samples: got 2, wanted 3"), HasSubstr("--fresh")));

  start_study();
  ASSERT_EQ(sut->wait(kPatience), 0) << sut->err();
  EXPECT_THAT(sut->err(), HasSubstr(std::to_string(killed) + " of 12 runs are taken from"));
  const json resumed = json::parse(contents(file));
  EXPECT_FALSE(resumed.contains("partial"));
  EXPECT_FALSE(std::filesystem::exists(file + ".journal"));

  start_study({"--fresh"});
  ASSERT_EQ(sut->wait(kPatience), 0) << sut->err();
  EXPECT_EQ(json::parse(contents(file))["models"], resumed["models"]);
}

TEST_F(Studies, OutputsAreCheckedBeforeTheWork) {
  for (const char* bad : {"/proc/x.json", "/nowhere/x.json", "."}) {
    EXPECT_EQ(finish("jostle_experiment", {"fig-6.7", "--json", bad}), 3) << bad;
    EXPECT_THAT(sut->err(), HasSubstr("--json: got")) << bad;
    EXPECT_EQ(finish("jostle_bench", {"cheap-physics", "--json", bad}), 3) << bad;
    EXPECT_THAT(sut->err(), HasSubstr("--json: got")) << bad;
  }
  for (const auto& [program, arguments] :
       {std::pair("jostle_experiment", std::vector<std::string>{"fig-6.7", "--plot", "x.jpg"}),
        std::pair("jostle_bench", std::vector<std::string>{"cheap-physics", "--plot", "x.jpg"}),
        std::pair("jostle_bench", std::vector<std::string>{"pool", "--timeline", "x.jpg"})}) {
    EXPECT_EQ(finish(program, arguments), 2) << program;
    EXPECT_THAT(sut->err(), HasSubstr("'x.jpg', wanted a name that ends in .png, .svg or .pdf")) << program;
  }
}

TEST_F(Studies, AFigureIsRedrawnFromItsNumbers) {
  ASSERT_EQ(finish("jostle_experiment", {"table-6.1", "--samples", "1", "--models", "kinematic", "--json", file}), 0)
      << sut->err();
  const std::string picture = folder.path() / "x.pdf";
  EXPECT_EQ(finish("jostle_experiment", {"table-6.1", "--redraw", file, "--plot", picture}), 0) << sut->err();
  EXPECT_TRUE(contents(picture).starts_with("%PDF"));
  EXPECT_EQ(finish("jostle_experiment", {"fig-7.2", "--redraw", file, "--plot", picture}), 2);
  EXPECT_THAT(sut->err(), HasSubstr("wanted a result of this study"));
}

TEST_F(Studies, EachHasItsOwnOptions) {
  const auto help = [&](const std::string& program, const std::vector<std::string>& words) {
    EXPECT_EQ(finish(program, words), 0) << sut->err();
    return sut->out();
  };
  EXPECT_THAT(help("jostle_experiment", {"fig-3.5", "--help"}), AllOf(HasSubstr("--levels"), Not(HasSubstr("--plot"))));
  EXPECT_THAT(help("jostle_experiment", {"fig-6.7", "--help"}), AllOf(HasSubstr("--plot"), Not(HasSubstr("--levels"))));
  EXPECT_THAT(help("jostle_bench", {"round-trip", "--help"}),
              AllOf(HasSubstr("--repeats"), HasSubstr("--domain"), Not(HasSubstr("--timeline"))));
  EXPECT_THAT(help("jostle_bench", {"bag", "--help"}), AllOf(HasSubstr("--repeats"), Not(HasSubstr("--domain"))));
  EXPECT_THAT(help("jostle_bench", {"--help"}), AllOf(HasSubstr("pool-threads"), Not(HasSubstr("publish"))));
  EXPECT_THAT(help("jostle_bench", {"list"}), AllOf(HasSubstr("round-trip"), HasSubstr(" min")));
  EXPECT_THAT(help("jostle_experiment", {"list"}), AllOf(HasSubstr("table-6.1"), HasSubstr(" min")));
  EXPECT_EQ(finish("jostle_bench", {"pool-threads", "--seed", "1"}), 2);
  EXPECT_THAT(sut->err(), HasSubstr("--seed"));
  EXPECT_EQ(finish("jostle_bench", {"nonsense"}), 2);
  EXPECT_THAT(sut->err(), HasSubstr("got 'nonsense', wanted one that `jostle bench list` shows"));
  EXPECT_EQ(finish("jostle_experiment", {"fig-0.0"}), 2);
  EXPECT_THAT(sut->err(), HasSubstr("got 'fig-0.0', wanted one of `jostle experiment list`"));
}

TEST_F(Studies, ABenchmarkShowsItsProgressAndKeepsWhatItHas) {
  start("jostle_bench", {"pool-threads", "--repeats", "100000", "--json", file});
  TerminalProcess terminal("jostle_bench", {"pool-threads", "--repeats", "100000"}, 200);
  ASSERT_TRUE(terminal.shows("left", kPatience));  // drawn over once a run is done
  ASSERT_TRUE(terminal.shows("\033[K", kPatience));
  ASSERT_TRUE(terminal.shows(" 6 of 200002", kPatience));
  terminal.signal(SIGTERM);
  EXPECT_EQ(terminal.wait(kPatience), 130);
  EXPECT_THAT(terminal.screen(), AllOf(HasSubstr("of 100000 repeats"), HasSubstr("jostle bench: interrupted")));
  sut->signal(SIGINT);
  ASSERT_EQ(sut->wait(kPatience), 130) << sut->err();
  EXPECT_THAT(sut->err(), HasSubstr("jostle bench: interrupted"));
}

}  // namespace
}  // namespace jostle::tests
