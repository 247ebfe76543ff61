#pragma once
/// \file
/// Terminal: keys as they are pressed, and one line that is drawn over and over.

#include <fmt/format.h>
#include <termios.h>

#include <string>
#include <string_view>
#include <utility>

namespace jostle::services {

/// Standard input without waiting for the end of a line, without echo. Ctrl-C stays a
/// signal; Ctrl-Z and Ctrl-S, which would leave a playback standing, do nothing.
/// Restored when this is destroyed. Does nothing unless standard input is a terminal
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

/// On standard error. Nothing is drawn where that is no terminal; what is said always is,
/// on a line of its own. Threads  one.
class LiveLine {
 public:
  explicit LiveLine(std::string speaker);
  ~LiveLine();
  LiveLine(const LiveLine&) = delete;
  LiveLine& operator=(const LiveLine&) = delete;

  bool live() const { return live_; }
  std::size_t width() const;  ///< characters that fit into it
  /// ASCII; what does not fit is cut off.
  void draw(std::string_view text);

  template <class... T>
  void say(fmt::format_string<T...> format, T&&... values) {
    finish();
    fmt::print(stderr, "{}: {}\n", speaker_, fmt::format(format, std::forward<T>(values)...));
  }

 private:
  void finish();

  const std::string speaker_;
  const bool live_;
  bool open_ = false;
};

}  // namespace jostle::services
