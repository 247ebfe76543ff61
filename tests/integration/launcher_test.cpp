// jostle itself: help of subcommands, what shells complete, the manual.

#include <gmock/gmock.h>

#include <cstdlib>
#include <sstream>

#include "tests/support/program_process.hpp"

namespace jostle::tests {
namespace {

using namespace std::chrono_literals;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

class Launcher : public ::testing::Test {
 protected:
  int run(const std::vector<std::string>& arguments) {
    process = std::make_unique<ProgramProcess>("jostle", arguments, folder);
    return process->wait(60s).value_or(-1);
  }

  // What bash offers for the last of these words.
  std::vector<std::string> completed(const std::vector<std::string>& words) {
    std::string line;
    for (const std::string& word : words) line += " '" + word + "'";
    const std::filesystem::path file = folder.path() / "completed";
    const std::string command = "cd '" + folder.path().string() + "' && PATH='" JOSTLE_PROGRAMS "':$PATH bash -c '. " +
                                JOSTLE_SOURCE_DIR "/deploy/completion/jostle.bash; COMP_WORDS=(\"$@\"); " +
                                "COMP_CWORD=$(($# - 1)); _jostle; printf \"%s\\n\" \"${COMPREPLY[@]}\"' bash jostle" +
                                line + " >'" + file.string() + "'";
    EXPECT_EQ(std::system(command.c_str()), 0) << command;
    std::vector<std::string> found;
    std::istringstream in(contents(file));
    for (std::string one; std::getline(in, one);) found.push_back(one);
    return found;
  }

  const TempFolder folder;
  std::unique_ptr<ProgramProcess> process;
};

TEST_F(Launcher, HelpOfASubcommandIsItsOwn) {
  ASSERT_EQ(run({"help", "scene", "generate"}), 0) << process->err();
  const std::string help = process->out();
  EXPECT_THAT(help, HasSubstr("--chapter"));
  ASSERT_EQ(run({"scene", "generate", "--help"}), 0);
  EXPECT_EQ(process->out(), help);
}

TEST_F(Launcher, UnknownNamesAreErrorsThatSayWhatWasMeant) {
  EXPECT_EQ(run({"help", "scene", "genrate"}), 2);
  EXPECT_THAT(process->err(), HasSubstr("jostle scene: unknown subcommand 'genrate'"));
  EXPECT_THAT(process->err(), HasSubstr("did you mean generate?"));
  EXPECT_EQ(run({"help", "doctor", "foo"}), 2);
  EXPECT_THAT(process->err(), HasSubstr("jostle doctor: got subcommand 'foo', wanted none"));
  EXPECT_EQ(run({"help", "scnee"}), 2);
  EXPECT_THAT(process->err(), HasSubstr("did you mean `jostle scene`?"));
}

TEST_F(Launcher, ShellsCompleteProgramsSubcommandsOptionsValuesAndFiles) {
  folder.write("scene.yaml", "");
  EXPECT_THAT(completed({"sce"}), ElementsAre("scene"));
  EXPECT_THAT(completed({"help", "doc"}), ElementsAre("doctor"));
  EXPECT_THAT(completed({"help", "scene", "g"}), ElementsAre("generate"));
  EXPECT_THAT(completed({"scene", ""}), ElementsAre("generate", "check", "perturb", "show"));
  EXPECT_THAT(completed({"scene", "generate", "--sh"}), ElementsAre("--shape"));
  EXPECT_THAT(completed({"scene", "generate", "--shape", ""}), ElementsAre("cylinder", "box"));
  EXPECT_THAT(completed({"scene", "check", "sc"}), ElementsAre("scene.yaml"));
  EXPECT_THAT(completed({"doctor", "--discovery", "mul"}), ElementsAre("multicast"));
}

TEST_F(Launcher, ManualHasAPageOfEveryProgram) {
  ASSERT_EQ(run({"--man"}), 0);
  const std::string list = process->out();
  std::istringstream programs(JOSTLE_PROGRAM_NAMES);
  for (std::string name; std::getline(programs, name, ',');) {
    std::ranges::replace(name, '_', '-');
    EXPECT_THAT(list, HasSubstr(".It Xr jostle-" + name + " 1\n")) << "no purpose in the launcher's list";
  }
  for (const char* name : {"scene", "doctor"}) {
    ASSERT_EQ(run({"--man", name}), 0) << process->err();
    EXPECT_THAT(process->out(), HasSubstr(".SH EXIT STATUS"));
    const auto page = folder.write("page.1", process->out());
    if (std::system("command -v groff >/dev/null") != 0) continue;
    const auto complaints = folder.path() / "complaints";
    EXPECT_EQ(std::system(("groff -man -Tutf8 -ww -z '" + page.string() + "' 2>'" + complaints.string() + "'").c_str()),
              0);
    EXPECT_EQ(contents(complaints), "") << name;
  }
}

TEST_F(Launcher, HelpSaysHowProgramsEnd) {
  for (const char* name : {"scene", "doctor"}) {
    ASSERT_EQ(run({"help", name}), 0);
    EXPECT_THAT(process->out(), HasSubstr("Exit codes: ")) << name;
  }
}

}  // namespace
}  // namespace jostle::tests
