#pragma once
/// \file
/// LiveLine: one line of a terminal that is drawn over and over.

#include <fmt/format.h>

#include <string>
#include <string_view>
#include <utility>

namespace jostle::common {

/// When lines are written one below the other instead of being drawn over: never, where standard error is no
/// terminal that understands escape codes, or always.
enum class PlainLines { kNever, kElsewhere, kAlways };

/// A LiveLine stands on standard error. What is drawn needs a terminal, or plain lines; what is said is always
/// written, on a line of its own. Threads  one.
class LiveLine {
 public:
  explicit LiveLine(std::string speaker, PlainLines plain = PlainLines::kNever);
  ~LiveLine();
  LiveLine(const LiveLine&) = delete;
  LiveLine& operator=(const LiveLine&) = delete;

  bool live() const { return live_; }  ///< whether it is drawn over
  bool visible() const { return live_ || plain_; }
  std::size_t width() const;  ///< characters that fit into it
  /// Draws ASCII; what does not fit is cut off, unless the line is a plain one.
  void draw(std::string_view text);
  void finish();  ///< leaves the line standing; what comes next has one of its own
  void wipe();    ///< as if nothing had been drawn

  template <class... T>
  void say(fmt::format_string<T...> format, T&&... values) {
    finish();
    fmt::print(stderr, "{}: {}\n", speaker_, fmt::format(format, std::forward<T>(values)...));
  }

 private:
  const std::string speaker_;
  const bool live_, plain_;
  bool open_ = false;  // a live line stands without its newline
};

}  // namespace jostle::common
