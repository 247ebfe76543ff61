// One line per kind of trouble and second.

#include "services/common/process/trouble.hpp"

#include <gtest/gtest.h>

namespace jostle::common {
namespace {

using namespace std::chrono_literals;
using ::testing::internal::CaptureStderr;
using ::testing::internal::GetCapturedStderr;

TEST(Trouble, SaysTheFirstCaseInFullAndTheOthersAsACount) {
  CaptureStderr();
  {
    Trouble sut("stale commands", 1h);
    for (int i = 1; i <= 1000; ++i) sut.warn("command {} is stale", i);
    EXPECT_EQ(sut.count(), 1000u);
  }
  EXPECT_EQ(GetCapturedStderr(),
            "warning: command 1 is stale\n"
            "warning: command 2 is stale (and 998 more stale commands since the last such line)\n");
}

TEST(Trouble, SaysEveryCaseWhenTheyAreRare) {
  CaptureStderr();
  Trouble sut("stale commands", 0ms);
  sut.warn("one");
  sut.warn("two");
  EXPECT_EQ(GetCapturedStderr(), "warning: one\nwarning: two\n");
}

TEST(Trouble, NotedElsewhereIsSaidWhenAskedFor) {
  CaptureStderr();
  Trouble sut("losses");
  sut.note("a loss");
  EXPECT_EQ(GetCapturedStderr(), "");
  CaptureStderr();
  sut.say();
  sut.say();
  EXPECT_EQ(GetCapturedStderr(), "warning: a loss\n");
}

TEST(Shown, LeavesReadableTextAsItIs) {
  EXPECT_EQ(shown("worker-1 (lab, Zürich) 你好"), "worker-1 (lab, Zürich) 你好");
  EXPECT_EQ(shown(""), "");
}

TEST(Shown, MakesControlCharactersVisible) {
  EXPECT_EQ(shown("\x1b[31mred\n\x7f"), "\\x1b[31mred\\x0a\\x7f");
  EXPECT_EQ(shown(std::string_view("a\0b", 3)), "a\\x00b");
  EXPECT_EQ(shown("\xc2\x9b"), "\\xc2\\x9b");  // a control character of Latin 1, in UTF-8
}

TEST(Shown, MakesWhatIsNoUtf8Visible) {
  EXPECT_EQ(shown("\xff\xc3"), "\\xff\\xc3");
  EXPECT_EQ(shown("\xe4"), "\\xe4");
}

TEST(Shown, CutsWhatIsTooLong) { EXPECT_EQ(shown(std::string(1'000'000, 'x'), 5), "xxxxx... (1000000 bytes)"); }

}  // namespace
}  // namespace jostle::common
