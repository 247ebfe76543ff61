#pragma once
/// \file
/// How far long, counted work has come, and how long it will take.

#include <chrono>
#include <cstdint>
#include <string>
#include <string_view>

#include "services/common/terminal/live_line.hpp"

namespace jostle::common {

struct ProgressLineOptions {
  std::string doing;  ///< such as "verifying"
  std::string unit;   ///< what is counted, in the plural
  PlainLines plain = PlainLines::kNever;
  bool wiped = false;  ///< at the end, as the result says it all
};

/// A ProgressLine shows "verifying: " and progress_text() on standard error: drawn over four times a second, as plain
/// lines every half minute; both at the beginning and when all is done. show() may be called for
/// every small message.
class ProgressLine {
 public:
  explicit ProgressLine(ProgressLineOptions options);
  ~ProgressLine();

  /// Shows that `done` of `total` are done, of which `found` cost no time.
  void show(std::uint64_t done, std::uint64_t total, std::uint64_t found = 0);

 private:
  using Clock = std::chrono::steady_clock;

  const ProgressLineOptions options_;
  LiveLine line_;
  const Clock::time_point start_ = Clock::now();
  Clock::time_point next_ = start_;
  std::uint64_t next_look_ = 0;  // at the clock: once so many are done
};

/// Writes "12400 of 300000 transitions (4 %), 96.3 per second, 49 min left", after `seconds`; the
/// last two only if they are known.
std::string progress_text(std::string_view unit, std::uint64_t done, std::uint64_t total, double seconds,
                          std::uint64_t found = 0);

/// Writes "48 s", "49 min", "2 h 05 min".
std::string duration_text(double seconds);

}  // namespace jostle::common
