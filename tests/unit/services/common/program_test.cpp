// How programs end.

#include "services/common/process/program.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include "services/common/process/files.hpp"

namespace jostle::common {
namespace {

using namespace std::chrono_literals;

class StopSignals : public ::testing::Test {
 protected:
  // A death test of a process with threads starts anew.
  void SetUp() override { GTEST_FLAG_SET(death_test_style, "threadsafe"); }
};

TEST_F(StopSignals, EndAProgramInWhichAThreadHangs) {
  EXPECT_EXIT(
      {
        const StopSignal signal(100ms);
        kill(getpid(), SIGTERM);
        for (;;) pause();
      },
      ::testing::ExitedWithCode(kExitBroken), "did not end within 0.1 s of the signal, some thread hangs");
}

TEST_F(StopSignals, EndAProgramWhoseStopCallbackHangs) {
  EXPECT_EXIT(
      {
        const StopSignal signal(100ms);
        const std::stop_callback hangs(signal.token(), [] {
          for (;;) pause();
        });
        kill(getpid(), SIGTERM);
        for (;;) pause();
      },
      ::testing::ExitedWithCode(kExitBroken), "some thread hangs");
}

TEST_F(StopSignals, LeaveAProgramThatEndsAlone) {
  EXPECT_EXIT(
      {
        const StopSignal signal(60s);
        kill(getpid(), SIGTERM);
        wait_for(signal.token());
        exit(kExitOk);
      },
      ::testing::ExitedWithCode(kExitOk), "^$");
}

// Death tests are processes of their own: they print what they made, and we look for it.
TEST_F(StopSignals, TakeTemporaryFoldersAlong) {
  std::string name = "/tmp/jostle-test-XXXXXX";
  ASSERT_TRUE(mkdtemp(name.data()));
  setenv("TMPDIR", name.c_str(), 1);
  EXPECT_EXIT(
      {
        const StopSignal signal(100ms);
        const auto folder_result = make_temporary_folder("test");
        if (!folder_result || !std::filesystem::exists(*folder_result)) exit(kExitFailed);
        kill(getpid(), SIGTERM);
        for (;;) pause();
      },
      ::testing::ExitedWithCode(kExitBroken), "");
  unsetenv("TMPDIR");
  EXPECT_TRUE(std::filesystem::is_empty(name));
  std::filesystem::remove_all(name);
}

}  // namespace
}  // namespace jostle::common
