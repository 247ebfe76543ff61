#include "services/common/terminal/live_line.hpp"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>

#include "services/common/terminal/terminal.hpp"

namespace jostle::common {

LiveLine::LiveLine(std::string speaker, PlainLines plain)
    : speaker_(std::move(speaker)),
      live_(plain != PlainLines::kAlways && shows_escape_codes(STDERR_FILENO)),
      plain_(plain != PlainLines::kNever && !live_) {}

LiveLine::~LiveLine() { finish(); }

std::size_t LiveLine::width() const {
  winsize size{};
  const bool known = ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 1;
  return known ? size.ws_col - 1u : 79u;  // a character in the last column may wrap
}

void LiveLine::draw(std::string_view text) {
  if (plain_) fmt::print(stderr, "{}\n", text);
  if (!live_) return;
  fmt::print(stderr, "\r{}\033[K", text.substr(0, width()));
  std::fflush(stderr);
  open_ = true;
}

void LiveLine::finish() {
  if (std::exchange(open_, false)) fmt::print(stderr, "\n");
}

void LiveLine::wipe() {
  if (std::exchange(open_, false)) fmt::print(stderr, "\r\033[K");
}

}  // namespace jostle::common
