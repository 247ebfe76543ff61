#pragma once
/// \file
/// Terminal: keys as they are pressed.

#include <termios.h>

#include <string>

namespace jostle::bags {

/// A Keyboard reads standard input without waiting for the end of a line, and without echo. Ctrl-C stays a
/// signal; Ctrl-Z and Ctrl-S, which would leave a playback standing, do nothing.
/// The terminal is restored when this is destroyed. Does nothing unless standard input is a terminal
/// and this program in its foreground.
class Keyboard {
 public:
  Keyboard();
  ~Keyboard();
  Keyboard(const Keyboard&) = delete;
  Keyboard& operator=(const Keyboard&) = delete;

  bool works() const { return works_; }
  int descriptor() const;
  /// What was typed. Call it when poll(2) says there is something.
  std::string read();

 private:
  termios before_{};
  bool works_ = false;
};

}  // namespace jostle::bags
