#include "services/common/process/command_line.hpp"

#include <gmock/gmock.h>

#include <CLI/CLI.hpp>

#include "services/common/process/cores.hpp"

namespace jostle::common {
namespace {

using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::StartsWith;

// A program like ours: options of its own, and another one with subcommands.
class CommandLine : public testing::Test {
 protected:
  CommandLine() {
    app.add_option("scene", scene, "Scene file")->required();
    auto* controller = app.add_option("--controller", word, "Which one \xE2\x80\xA6;\nall of them");
    suggest(controller, {"or", "nr", "mpc"});
    app.add_option("--pool", word, "Where")->check(CLI::IsMember({"dds", "threads"}));
    add_count_option(app, "--workers", count, 0, "How many");
    add_seed_option(app, "--seed", seed, "Of the noise");
    app.add_option("--rate", rate, "Speed")->check(CLI::Range(0.0, 1000.0))->capture_default_str();
    app.add_option("--length", rate, "How long")->check(CLI::PositiveNumber);
    app.add_option("--json", word, "File");
    app.add_option("--inner", count, "For ourselves")->group("");
    app.footer("Example\n  jostle run x.yaml\nExit codes: 0 done, 1 not.");

    bag.require_subcommand(1);
    CLI::App* info = bag.add_subcommand("info", "topics and types");
    info->add_option("bag", word, "a folder")->required();
    CLI::App* exports = bag.add_subcommand("export", "messages, as tables");
    exports->add_option("bag", word, "a folder")->required();
    exports->add_option_group("form")->add_flag("--csv", flag, "a table");
  }

  static std::string mistake(CLI::App& program, std::vector<std::string> words) {
    std::reverse(words.begin(), words.end());
    try {
      program.parse(words);
    } catch (const CLI::ParseError& error) {
      return explain(program, error);
    }
    return "";
  }

  CLI::App app{"Plans a scene.", "jostle run"};
  CLI::App bag{"Looks into recordings.", "jostle bag"};
  std::string scene, word;
  int count = 0;
  std::uint64_t seed = 0;
  double rate = 1.0;
  bool flag = false;
};

TEST_F(CommandLine, NamesTheOptionThatWasMeant) {
  EXPECT_EQ(mistake(app, {"--controler", "nr"}), "jostle run: unknown option --controler; did you mean --controller?");
  EXPECT_EQ(mistake(app, {"x.yaml", "--jsn=a"}), "jostle run: unknown option --jsn; did you mean --json?");
  EXPECT_EQ(mistake(app, {"x.yaml", "--quux"}), "jostle run: unknown option --quux; `jostle run --help` says more");
  EXPECT_EQ(mistake(bag, {"info", "a", "--csvv"}),
            "jostle bag: unknown option --csvv; `jostle bag info --help` says more");
  EXPECT_EQ(mistake(bag, {"export", "a", "--cvs"}), "jostle bag: unknown option --cvs; did you mean --csv?");
}

TEST_F(CommandLine, NamesTheSubcommandThatWasMeant) {
  EXPECT_EQ(mistake(bag, {"inof", "a"}),
            "jostle bag: unknown subcommand 'inof', wanted info, export; did you mean info?");
  EXPECT_THAT(mistake(bag, {}), StartsWith("jostle bag: got no subcommand, wanted info, export"));
}

TEST_F(CommandLine, SaysWhatWasGotAndWhatIsWanted) {
  const std::vector<std::pair<std::vector<std::string>, std::string>> cases{
      {{"x", "--workers", "two"}, "--workers: got 'two', wanted auto or 0 to 1024"},
      {{"x", "--workers", "1025"}, "--workers: got '1025', wanted auto or 0 to 1024"},
      {{"x", "--pool", "treads"}, "--pool: got 'treads', wanted dds, threads; did you mean threads?"},
      {{"x", "--seed", "abc"}, "--seed: got 'abc', wanted a whole number"},
      {{"x", "--seed", "-1"}, "--seed: got '-1', wanted a whole number"},
      {{"x", "--seed", "18446744073709551616"}, "--seed: got '18446744073709551616', wanted a whole number"},
      {{"x", "--rate", "2000"}, "--rate: got '2000', wanted 0 to 1000"},
      {{"x", "--length", "0"}, "--length: got '0', wanted a number above 0"},
      {{"x", "--json"}, "--json: got no value, wanted TEXT"},
      {{"x", "y"}, "got 'y', wanted nothing more"},
      {{}, "got no scene, wanted one"},
  };
  for (const auto& [words, wanted] : cases) {
    EXPECT_THAT(mistake(app, words), StartsWith("jostle run: " + wanted));
    app.clear();
  }
}

TEST_F(CommandLine, TakesAutoAndNumbersForACount) {
  EXPECT_EQ(mistake(app, {"x", "--workers", "7"}), "");
  EXPECT_EQ(count, 7);
  EXPECT_EQ(mistake(app, {"x", "--workers", "auto"}), "");
  EXPECT_EQ(count, usable_cores());
}

TEST_F(CommandLine, HelpIsThatOfTheSubcommand) {
  EXPECT_THAT(help_of(bag, {}).value(), HasSubstr("Usage: jostle bag "));
  EXPECT_THAT(help_of(bag, {"export"}).value(), HasSubstr("Usage: jostle bag export "));
  EXPECT_THAT(help_of(bag, {"export"}).value(), HasSubstr("--csv"));
  EXPECT_THAT(help_of(app, {}).value(), Not(HasSubstr("--inner")));
  EXPECT_EQ(help_of(bag, {"exprot"}).error().message,
            "jostle bag: unknown subcommand 'exprot', wanted info, export; did you mean export?");
  EXPECT_EQ(help_of(app, {"foo"}).error().message, "jostle run: got subcommand 'foo', wanted none: there are none");
}

TEST_F(CommandLine, CompletesSubcommandsOptionsValuesAndFiles) {
  EXPECT_THAT(completions(bag, {""}), ElementsAre("info\ttopics and types", "export\tmessages, as tables"));
  EXPECT_THAT(completions(bag, {"info", ""}), ElementsAre(":files"));
  EXPECT_THAT(completions(bag, {"export", "--"}), Contains("--csv\ta table"));
  EXPECT_THAT(completions(bag, {"info", "--"}), Not(Contains(StartsWith("--csv"))));
  EXPECT_THAT(completions(app, {""}), ElementsAre(":files"));
  EXPECT_THAT(completions(app, {"--"}), Contains(StartsWith("--controller\tWhich one")));
  EXPECT_THAT(completions(app, {"--"}), Not(Contains(StartsWith("--inner"))));
  EXPECT_THAT(completions(app, {"--controller", ""}), ElementsAre("or", "nr", "mpc"));
  EXPECT_THAT(completions(app, {"--pool", ""}), ElementsAre("dds", "threads"));
  EXPECT_THAT(completions(app, {"--workers", ""}), ElementsAre("auto"));
  EXPECT_THAT(completions(app, {"--seed", ""}), IsEmpty());
  EXPECT_THAT(completions(app, {"--json", ""}), ElementsAre(":files"));
  EXPECT_THAT(completions(app, {"x.yaml", ""}), Contains("--seed\tOf the noise"));
}

TEST_F(CommandLine, ManualPageHasEveryOptionAndSubcommand) {
  const std::string page = manual_page(app, "plan a scene");
  EXPECT_THAT(page, StartsWith(".TH JOSTLE-RUN 1"));
  for (const char* part :
       {"jostle\\-run \\- plan a scene", "\\fB\\-\\-controller\\fR", "\\fIdds|threads\\fR", "Which one \\[u2026];",
        "Default: 1.", ".SH EXIT STATUS\n0 done, 1 not.", "jostle run x.yaml"})
    EXPECT_THAT(page, HasSubstr(part));
  EXPECT_THAT(page, Not(HasSubstr("inner")));
  const std::string bags = manual_page(bag, "look into bags");
  for (const char* part : {".SS info", ".SS export", "\\fB\\-\\-csv\\fR"}) EXPECT_THAT(bags, HasSubstr(part));
}

TEST_F(CommandLine, ExitCodesAreDocumentedOnce) {
  document_exit_codes(bag);
  document_exit_codes(bag);
  EXPECT_THAT(bag.get_footer(), StartsWith("Exit codes: 0 done, 1 the task failed, 2 bad input"));
  document_exit_codes(app);
  EXPECT_THAT(app.get_footer(), Not(HasSubstr("bad input")));
}

}  // namespace
}  // namespace jostle::common
