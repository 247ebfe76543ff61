#include "services/common/terminal/live_line.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "services/common/terminal/fitted_line.hpp"
#include "services/common/terminal/progress_line.hpp"

namespace jostle::common {
namespace {

using ::testing::MatchesRegex;

// Standard error is a terminal of 21 columns, or a pipe, for as long as this lives.
class StandardError {
 public:
  explicit StandardError(bool is_terminal) : before_(dup(STDERR_FILENO)) {
    int ends[2] = {-1, -1};
    if (is_terminal) {
      ends[0] = posix_openpt(O_RDWR | O_NOCTTY);
      grantpt(ends[0]);
      unlockpt(ends[0]);
      ends[1] = open(ptsname(ends[0]), O_RDWR | O_NOCTTY);
      const winsize size{.ws_row = 24, .ws_col = 21, .ws_xpixel = 0, .ws_ypixel = 0};
      ioctl(ends[1], TIOCSWINSZ, &size);
    } else if (pipe(ends) != 0) {
      ADD_FAILURE() << "no pipe";
    }
    read_ = ends[0];
    dup2(ends[1], STDERR_FILENO);
    close(ends[1]);
  }
  ~StandardError() {
    dup2(before_, STDERR_FILENO);
    close(before_);
    close(read_);
  }

  /// What was written since the last call; a terminal makes "\r\n" of "\n".
  std::string text() const {
    std::string text;
    for (pollfd readable{.fd = read_, .events = POLLIN, .revents = 0}; poll(&readable, 1, 0) > 0;) {
      char bytes[1024];
      const ssize_t count = read(read_, bytes, sizeof bytes);
      if (count <= 0) break;
      text.append(bytes, static_cast<std::size_t>(count));
    }
    return text;
  }

 private:
  int before_ = -1, read_ = -1;
};

TEST(LiveLine, IsDrawnOverCutOffAndFinishedOnATerminal) {
  const StandardError error(true);
  LiveLine sut("jostle test", PlainLines::kElsewhere);
  EXPECT_TRUE(sut.live());
  sut.draw("one");
  sut.draw("two 78901234567890123");
  EXPECT_EQ(error.text(), "\rone\033[K\rtwo 7890123456789012\033[K");
  sut.say("{} words", 2);
  EXPECT_EQ(error.text(), "\r\njostle test: 2 words\r\n");
}

TEST(LiveLine, WipesWhatItHasDrawnAndNothingElse) {
  const StandardError error(true);
  LiveLine sut("jostle test");
  sut.wipe();
  EXPECT_EQ(error.text(), "");
  sut.draw("one");
  sut.wipe();
  sut.finish();
  EXPECT_EQ(error.text(), "\rone\033[K\r\033[K");
}

TEST(LiveLine, OnATerminalThatIsDumbOnlyPlainLinesAreDrawn) {
  const char* terminal = std::getenv("TERM");
  const std::string before = terminal ? terminal : "xterm";
  setenv("TERM", "dumb", 1);
  const StandardError error(true);
  {
    LiveLine silent("jostle test"), sut("jostle test", PlainLines::kElsewhere);
    silent.draw("nothing");
    sut.draw("one");
    sut.draw("two");
    sut.wipe();
  }
  setenv("TERM", before.c_str(), 1);
  EXPECT_EQ(error.text(), "one\r\ntwo\r\n");
}

TEST(LiveLine, WhereThereIsNoTerminalOnlyPlainLinesAreDrawn) {
  const StandardError error(false);
  LiveLine silent("jostle test"), sut("jostle test", PlainLines::kElsewhere);
  EXPECT_FALSE(silent.visible());
  EXPECT_FALSE(sut.live());
  silent.draw("nothing");
  sut.draw("a line that is longer than a terminal of 79 columns, which plain lines may well be");
  sut.wipe();
  EXPECT_EQ(error.text(), "a line that is longer than a terminal of 79 columns, which plain lines may well be\n");
}

TEST(LiveLine, PlainLinesMayBeAskedForOnATerminal) {
  const StandardError error(true);
  LiveLine sut("jostle test", PlainLines::kAlways);
  sut.draw("one");
  sut.draw("two");
  EXPECT_EQ(error.text(), "one\r\ntwo\r\n");
}

TEST(ProgressLine, ShowsTheBeginningAndTheEndOfQuickWork) {
  const StandardError error(false);
  {
    ProgressLine sut({.doing = "testing", .unit = "steps", .plain = PlainLines::kElsewhere});
    for (std::uint64_t done = 0; done <= 5000; ++done) sut.show(done, 5000);
  }
  EXPECT_THAT(
      error.text(),
      MatchesRegex("testing: 0 of 5000 steps \\(0 %\\)\ntesting: 5000 of 5000 steps \\(100 %\\), .* per second\n"));
}

TEST(ProgressLine, IsWipedAtTheEndIfSoAsked) {
  const StandardError error(true);
  { ProgressLine({.doing = "testing", .unit = "steps", .wiped = true}).show(0, 9); }
  EXPECT_EQ(error.text(), "\rtesting: 0 of 9 step\033[K\r\033[K");
}

TEST(FittedLine, LeavesOutTheLeastImportantUntilItFits) {
  const std::vector<LinePart> parts{{"12 s planning", 0}, {"cost 7", 2}, {"target 3 cm", 1}, {"a:1", 3}, {"b:2", 4}};
  EXPECT_EQ(fitted_line(parts, 80), "12 s planning  cost 7  target 3 cm  a:1  b:2");
  EXPECT_EQ(fitted_line(parts, 43), "12 s planning  cost 7  target 3 cm  a:1");
  EXPECT_EQ(fitted_line(parts, 30), "12 s planning  target 3 cm");
  EXPECT_EQ(fitted_line(parts, 5), "12 s planning");
  EXPECT_EQ(fitted_line({}, 5), "");
}

TEST(ProgressText, SaysShareRateAndTimeLeftWhileTheyAreKnown) {
  EXPECT_EQ(progress_text("frames", 0, 10, 0.0), "0 of 10 frames (0 %)");
  EXPECT_EQ(progress_text("frames", 4, 10, 2.0), "4 of 10 frames (40 %), 2.0 per second, 3 s left");
  EXPECT_EQ(progress_text("frames", 10, 10, 5.0), "10 of 10 frames (100 %), 2.0 per second");
  EXPECT_EQ(progress_text("frames", 4, 10, 2.0, 4), "4 of 10 frames (40 %)");
  EXPECT_EQ(progress_text("frames", 8, 20, 2.0, 4), "8 of 20 frames (40 %), 2.0 per second, 6 s left");
  EXPECT_EQ(progress_text("frames", 12, 10, 6.0), "12 of 10 frames (100 %), 2.0 per second");
  EXPECT_EQ(progress_text("frames", 0, 0, 1.0), "0 of 0 frames (100 %)");
}

TEST(DurationText, HasTheUnitOneWouldSay) {
  EXPECT_EQ(duration_text(48.2), "48 s");
  EXPECT_EQ(duration_text(49 * 60), "49 min");
  EXPECT_EQ(duration_text(125 * 60), "2 h 05 min");
}

}  // namespace
}  // namespace jostle::common
