// What programs write, and where to: files, devices, pipes, terminals; and what they are told in numbers.

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <sys/wait.h>

#include <cstdlib>

#include "tests/support/run_fixture.hpp"
#include "tests/support/terminal_process.hpp"

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

const std::string kBag = JOSTLE_SOURCE_DIR "/tests/data/bags/push";

class Outputs : public RunFixture {
 protected:
  struct Ended {
    int code = -1;
    std::string err;
  };

  // A command line as a shell takes it, with the programs on PATH.
  Ended shell(const std::string& command) const {
    const fs::path err = folder.path() / "err";
    const std::string line =
        fmt::format("export PATH={}:$PATH ROS_DOMAIN_ID={} TMPDIR={}; cd {}; exec 2>{}; {}", JOSTLE_PROGRAMS, domain,
                    folder.path().string(), folder.path().string(), err.string(), command);
    const int status = std::system(fmt::format("bash -c '{}'", line).c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, contents(err)};
  }

  bool has(const std::string& name) const { return fs::exists(folder.path() / name); }
};

TEST_F(Outputs, StandardOutputThatIsFullIsAnErrorInEveryProgram) {
  for (const char* command :
       {"jostle_scene generate", "jostle_scene --help", "jostle_bag --help", "jostle_worker --help",
        "jostle_play --help", "jostle_run --help", "jostle_keys --help", "jostle --version"}) {
    const Ended full = shell(std::string(command) + " >/dev/full");
    EXPECT_EQ(full.code, 3) << command;
    EXPECT_THAT(full.err, HasSubstr("standard output: cannot be written: No space left on device")) << command;
    const Ended closed = shell(std::string(command) + " >&-");
    EXPECT_EQ(closed.code, 3) << command;
  }
}

TEST_F(Outputs, StandardOutputThatNobodyReadsIsAnError) {
  const Ended ended = shell("{ jostle_scene generate --objects 40; echo $? >code; } | true");
  EXPECT_THAT(contents(folder.path() / "code"), testing::AnyOf("3\n", "0\n"));  // 0: it was quicker than true
  const Ended closed = shell("mkfifo p; exec 3<>p 4>p 3<&-; jostle_scene generate >&4");
  EXPECT_EQ(closed.code, 3) << ended.err;
  EXPECT_THAT(closed.err, HasSubstr("standard output: cannot be written: Broken pipe"));
}

TEST_F(Outputs, ThatAreReadTooAreRefused) {
  ASSERT_EQ(shell("jostle_scene generate -o a.yaml && ln a.yaml b.json").code, 0);
  const std::string before = contents(folder.path() / "a.yaml");
  for (const char* command : {"jostle_run a.yaml --json a.yaml", "jostle_run a.yaml --json b.json"}) {
    const Ended ended = shell(command);
    EXPECT_EQ(ended.code, 2) << command;
    EXPECT_THAT(ended.err, HasSubstr("which is read, too")) << command;
  }
  EXPECT_EQ(contents(folder.path() / "a.yaml"), before);
}

TEST_F(Outputs, StandardErrorThatIsFullOrClosedEndsNothing) {
  EXPECT_EQ(shell("jostle_scene check none.yaml 2>/dev/full").code, 2);
  EXPECT_EQ(shell("jostle_scene check none.yaml 2>&-").code, 2);
  EXPECT_EQ(shell("jostle_scene generate -o a.yaml >&- 2>&- <&-").code, 0);
  EXPECT_EQ(shell("jostle_scene check a.yaml").code, 0);
}

TEST_F(Outputs, DevicesLinksAndPipesAreWrittenToAndStay) {
  EXPECT_EQ(shell("ln -s target link; jostle_scene generate -o link").code, 0);
  EXPECT_TRUE(fs::is_symlink(folder.path() / "link") && has("target"));
  EXPECT_EQ(shell("mkfifo pipe; cat pipe >read & jostle_scene generate -o pipe; wait; cmp read target").code, 0);
  EXPECT_EQ(shell("jostle_scene generate -o /dev/stdout >copy && cmp copy target").code, 0);
  EXPECT_EQ(shell("jostle_scene generate -o - | cmp - target").code, 0);
  if (mknod((folder.path() / "null").c_str(), S_IFCHR | 0600, 1 << 8 | 3) != 0) return;  // needs root
  EXPECT_EQ(shell("jostle_scene generate -o null").code, 0);
  EXPECT_EQ(shell("jostle_play " + kBag + " --rate 100 --json null").code, 0);
  EXPECT_TRUE(fs::is_character_file(folder.path() / "null"));
}

TEST_F(Outputs, InputsMayBePipesAndStandardInput) {
  EXPECT_EQ(shell("jostle_scene generate | jostle_scene check -").code, 0);
  EXPECT_EQ(shell("jostle_scene generate | jostle_scene show --json /dev/stdin").code, 0);
  EXPECT_EQ(shell("jostle_scene check <(jostle_scene generate) <(jostle_scene generate --seed 2)").code, 0);
  EXPECT_EQ(shell("jostle_scene check - </dev/null").code, 2);
  EXPECT_EQ(shell("jostle_scene check .").code, 2);
}

TEST_F(Outputs, AreCheckedBeforeTheWorkAndAllNamed) {
  const std::string bad = "--json no/x.json --picture x.jpg --record " + fs::path(easy).parent_path().string();
  const Ended refused = shell("jostle_run " + easy + " --headless " + bad);
  EXPECT_EQ(refused.code, 2);
  EXPECT_THAT(refused.err,
              AllOf(HasSubstr("--json: got "), HasSubstr("folder no is not there"), HasSubstr("--picture: got "),
                    HasSubstr(".png"), HasSubstr("--record: got "), HasSubstr("in which there is something")));
  EXPECT_THAT(refused.err, Not(HasSubstr("iteration")));
  EXPECT_EQ(shell("jostle_run " + easy + " --headless --json /proc/x.json").code, 3);
  EXPECT_EQ(shell("jostle_run " + easy + " --headless --picture " + folder.path().string()).code, 3);
  EXPECT_EQ(shell("jostle_run " + easy + " --headless --picture picture").code, 2);
  EXPECT_EQ(shell("jostle_play " + kBag + " --json no/x").code, 3);
  EXPECT_EQ(shell("jostle_scene generate -o no/x").code, 3);
  EXPECT_EQ(shell("jostle_keys init no/keys").code, 3);
  EXPECT_FALSE(has("no"));
  EXPECT_THAT(run_folders(), IsEmpty());
}

TEST_F(Outputs, PicturesHaveAnEndingAndAFolderOfTheirOwn) {
  const Ended folder_taken = shell("jostle_render " + kBag + " -o .");
  EXPECT_EQ(folder_taken.code, 2);
  EXPECT_THAT(folder_taken.err, AllOf(HasSubstr("in which there is something"), HasSubstr(".png, .mp4 or .gif")));
  const Ended other = shell("jostle_render " + easy + " -o a.jpg");
  EXPECT_EQ(other.code, 2);
  EXPECT_THAT(other.err, HasSubstr("ends in .png, .mp4, .gif"));
  const Ended film = shell("jostle_render " + easy + " -o a.mp4");
  EXPECT_EQ(film.code, 2);
  EXPECT_THAT(film.err, HasSubstr("for a scene's start, wanted .png"));
  EXPECT_EQ(shell("jostle_render " + easy + " -o - --size 64x48 >a.png").code, 0);
  EXPECT_THAT(contents(folder.path() / "a.png").substr(1, 3), "PNG");
}

TEST_F(Outputs, NumbersAreDecimalAndFiniteInEveryProgram) {
  for (const char* command :
       {"jostle_scene generate --seed -1", "jostle_scene generate --seed 0x10", "jostle_scene generate --table nan",
        "jostle_scene generate --table inf", "jostle_scene generate --seed 1e3", "jostle_run scene --seed -1",
        "jostle_run scene --rate nan", "jostle_play bag --rate nan", "jostle_play bag --start inf",
        "jostle_play bag --timeout nan", "jostle_bag export bag --csv --from nan", "jostle_sim scene --seed -1",
        "jostle_worker --memory -1", "jostle_worker --domain 0x1", "jostle_render bag -o x.png --fps nan",
        "jostle_keys init k --days 1.5"}) {
    const Ended ended = shell(command);
    EXPECT_EQ(ended.code, 2) << command;
    EXPECT_THAT(ended.err, AllOf(HasSubstr("got '"), HasSubstr("wanted a "))) << command;
  }
  EXPECT_EQ(shell("jostle_scene generate --seed 010 -o a; jostle_scene generate --seed 10 -o b; cmp a b").code, 0);
}

TEST_F(Outputs, EmptyTextsAreRefused) {
  for (const char* command : {"jostle_worker --name \"\"", "jostle_scene check \"\"", "jostle_scene generate -o \"\"",
                              "jostle_run \"\"", "jostle_play bag --json \"\""}) {
    const Ended ended = shell(command);
    EXPECT_EQ(ended.code, 2) << command;
    EXPECT_THAT(ended.err, HasSubstr("got ''")) << command;
  }
}

TEST_F(Outputs, OptionsThatMeanNothingForAChapterAreRefused) {
  for (const char* options : {"--chapter 3 --shape box", "--integrator rk4", "--chapter 7 --table 1"})
    EXPECT_EQ(shell(std::string("jostle_scene generate ") + options).code, 2) << options;
}

TEST_F(Outputs, CheckLooksAtEveryFileAndTellsEverything) {
  folder.write("bad.yaml",
               "jostle_scene: 2\nobjects:\n  - name: a\n    shape: box\n    size: [0.04, 0.04, 0.04]\n    mass: -1\n"
               "    frictoin: 0.4\n    pose: {x: 0, y: x}\ntask: {target: b}\n");
  folder.write("wide.yaml", physics_pool::to_yaml([] {
                 auto scene = three_objects();
                 auto& target = scene.objects[static_cast<std::size_t>(scene.target())];
                 target.shape = physics_pool::Shape::kCylinder;
                 target.radius = 0.05;
                 target.height = 0.05;
                 return scene;
               }()));
  const Ended ended = shell("jostle_scene check bad.yaml " + easy + " none.yaml wide.yaml >out");
  EXPECT_EQ(ended.code, 2);
  EXPECT_THAT(ended.err,
              AllOf(HasSubstr("bad.yaml:6: objects[0] ('a').mass: got -1"),
                    HasSubstr("unknown key frictoin, did you mean friction?"),
                    HasSubstr("bad.yaml:8: objects[0].pose.y: got 'x'"), HasSubstr("none.yaml: missing"),
                    HasSubstr("wide.yaml: the target 'target' is 100.0 mm wide, the hand opens to 85.0 mm")));
  EXPECT_THAT(contents(folder.path() / "out"), AllOf(HasSubstr(easy + ": ok "), HasSubstr("wide.yaml: ok ")));
}

TEST_F(Outputs, TerminalThatIsDumbSeesNoEscapeCodes) {
  setenv("ROS_DOMAIN_ID", std::to_string(domain).c_str(), 1);
  TerminalProcess play("jostle_play", {kBag, "--rate", "100"}, 120, "dumb");
  EXPECT_EQ(play.wait(kPatience), 0);
  EXPECT_THAT(play.screen(), AllOf(HasSubstr("jostle play: "), Not(HasSubstr("\033"))));
}

TEST_F(Outputs, TemporaryPlaceThatIsNoneIsNamed) {
  const Ended ended = shell("TMPDIR=/nonexistent jostle_run " + easy + " --headless --workers 1");
  EXPECT_EQ(ended.code, 3);
  EXPECT_THAT(ended.err, HasSubstr("TMPDIR: got '/nonexistent', wanted a folder that is there"));
}

TEST_F(Outputs, RunWhoseTerminalIsGoneLeavesNothing) {
  start_planning();
  run->signal(SIGHUP);
  EXPECT_EQ(run->wait(kPatience), 130);
  EXPECT_THAT(run_folders(), IsEmpty());
  EXPECT_THAT(run->left_over(), IsEmpty());
}

TEST_F(Outputs, RunWhoseReaderIsGoneEndsAndLeavesNothing) {
  EXPECT_EQ(shell("jostle_run " + easy + " --workers 1 --headless --parameters " + endless + " 2>&1 | head -1").code,
            0);
  EXPECT_TRUE(soon(kPatience, [&] { return run_folders().empty(); }));
}

TEST_F(Outputs, FolderOfARunThatWasKilledIsRemovedByTheNext) {
  start_planning();
  run->signal(SIGKILL);
  run->wait(kPatience);
  ASSERT_EQ(run_folders().size(), 1u);
  EXPECT_TRUE(soon(kPatience, [&] { return run->left_over().empty(); }));
  EXPECT_EQ(finish({easy, "--parameters", plain}), 0);
  EXPECT_THAT(run_folders(), IsEmpty());
}

}  // namespace
}  // namespace jostle::tests
