#pragma once
/// \file
/// LiveLine: one line of a terminal that is drawn over and over.

#include <fmt/format.h>

#include <string>
#include <string_view>
#include <utility>

namespace jostle::services {

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
