// How children end, as a value.

#include "services/common/process/child_process.hpp"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/wait.h>

#include "tests/support/temp_folder.hpp"

namespace jostle::common {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

class Child : public ::testing::Test {
 protected:
  ChildProcess shell(const std::string& script) {
    auto child_result = ChildProcess::start("/bin/sh", {"-c", script}, folder.path() / "log");
    if (!child_result) throw std::runtime_error(child_result.error().message);
    return std::move(child_result).value();
  }

  const tests::TempFolder folder;
};

TEST_F(Child, ThatSucceedsIsOk) {
  ChildProcess sut = shell("exit 0");
  EXPECT_EQ(sut.wait(), (ExitStatus{.code = 0}));
  EXPECT_TRUE(sut.ended()->ok());
  EXPECT_EQ(sut.ended()->text(), "exit code 0");
}

TEST_F(Child, ThatFailsHasItsExitCode) {
  ChildProcess sut = shell("echo why; exit 3");
  const auto ended = sut.wait_for(10s);
  ASSERT_TRUE(ended);
  EXPECT_EQ(*ended, (ExitStatus{.code = 3}));
  EXPECT_FALSE(ended->ok());
  EXPECT_EQ(ended->text(), "exit code 3");
  EXPECT_THAT(sut.last_words(), HasSubstr("why"));
}

TEST_F(Child, ThatIsKilledHasItsSignalAndNoCode) {
  ChildProcess sut = shell("kill -9 $$");
  const ExitStatus ended = sut.wait();
  EXPECT_EQ(ended, (ExitStatus{.code = -1, .signal = SIGKILL}));
  EXPECT_FALSE(ended.ok());
  EXPECT_THAT(ended.text(), HasSubstr("killed by signal 9"));
}

TEST_F(Child, ThatRunsHasNotEnded) {
  ChildProcess sut = shell("exec sleep 60");
  EXPECT_FALSE(sut.ended());
  EXPECT_FALSE(sut.wait_for(1ms));
  sut.terminate();
  EXPECT_EQ(sut.wait().signal, SIGTERM);
}

TEST_F(Child, ThatSomebodyElseWaitedForIsGoneAndNotOk) {
  ChildProcess sut = shell("exit 0");
  ASSERT_EQ(waitpid(sut.pid(), nullptr, 0), sut.pid());
  ASSERT_TRUE(sut.ended());
  EXPECT_FALSE(sut.ended()->ok()) << "nobody knows";
}

TEST(RunTool, SaysHowItFailed) {
  const tests::TempFolder folder;
  EXPECT_TRUE(run_tool("true", "coreutils", {}, folder.path() / "log"));
  const auto result = run_tool("false", "coreutils", {}, folder.path() / "log");
  ASSERT_FALSE(result);
  EXPECT_THAT(result.error().message, HasSubstr("false: exit code 1"));
}

}  // namespace
}  // namespace jostle::common
