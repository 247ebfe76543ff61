#include "services/bags/play/terminal.hpp"

#include <unistd.h>

namespace jostle::bags {

Keyboard::Keyboard() {
  // In the background, asking a terminal for anything would stop this program.
  if (!isatty(STDIN_FILENO) || tcgetpgrp(STDIN_FILENO) != getpgrp()) return;
  if (tcgetattr(STDIN_FILENO, &before_) != 0) return;
  termios wanted = before_;
  wanted.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
  wanted.c_iflag &= ~static_cast<tcflag_t>(IXON);
  wanted.c_cc[VSUSP] = _POSIX_VDISABLE;
  wanted.c_cc[VMIN] = 0;
  wanted.c_cc[VTIME] = 0;
  works_ = tcsetattr(STDIN_FILENO, TCSADRAIN, &wanted) == 0;
}

Keyboard::~Keyboard() {
  if (works_) tcsetattr(STDIN_FILENO, TCSADRAIN, &before_);
}

int Keyboard::descriptor() const { return STDIN_FILENO; }

std::string Keyboard::read() {
  char bytes[64];
  const ssize_t count = ::read(STDIN_FILENO, bytes, sizeof bytes);
  if (count > 0) return {bytes, static_cast<std::size_t>(count)};
  works_ = false;  // hung up; there is nothing to restore
  return {};
}

}  // namespace jostle::bags
