#pragma once
/// \file
/// Trouble that may come in floods, as lines that do not.

#include <fmt/format.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <string>
#include <string_view>
#include <utility>

namespace jostle::common {

/// Returns what somebody else wrote, fit to be shown: control characters and what is not UTF-8 as \xNN, and cut after
/// `most` bytes, with a word about how many there were.
std::string shown(std::string_view text, std::size_t most = 200);

/// One kind of trouble. Cases are noted as they come, and said as one line a second at most: the first one in full, the
/// others as a count. What was not said yet is said when the object goes.
///
/// Threads  safe from any thread. A log may block: where that matters, note() there and say() on another thread.
class Trouble {
 public:
  /// `cases`: what is counted, in the plural, such as "stale commands".
  explicit Trouble(std::string cases, std::chrono::milliseconds pause = std::chrono::seconds(1))
      : cases_(std::move(cases)), pause_(pause) {}
  ~Trouble();
  Trouble(const Trouble&) = delete;
  Trouble& operator=(const Trouble&) = delete;

  /// Counts a case. The text is made of the first one since the last line only.
  template <class... Arguments>
  void note(fmt::format_string<Arguments...> text, Arguments&&... arguments) {
    const std::lock_guard lock(mutex_);
    ++count_;
    if (unsaid_++ == 0) first_ = fmt::format(text, std::forward<Arguments>(arguments)...);
  }

  /// Writes what was noted to the log, if there is something and it is time.
  void say();

  /// Does both.
  template <class... Arguments>
  void warn(fmt::format_string<Arguments...> text, Arguments&&... arguments) {
    note(text, std::forward<Arguments>(arguments)...);
    say();
  }

  /// Returns the number of cases so far, said or not.
  std::uint64_t count() const;

 private:
  const std::string cases_;
  const std::chrono::milliseconds pause_;
  mutable std::mutex mutex_;  // guards everything below
  std::chrono::steady_clock::time_point next_;
  std::string first_;  // since the last line
  std::uint64_t count_ = 0;
  std::uint64_t unsaid_ = 0;
};

}  // namespace jostle::common
