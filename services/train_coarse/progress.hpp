#pragma once
/// \file
/// A line on the terminal that says how far long work is.

#include <chrono>
#include <cstdint>
#include <string>

namespace jostle::services {

/// "12 400 of 300 000, 96.3 per second, 49 min left", at most twice a second; on a
/// terminal in place, otherwise a line every half minute.
class ProgressLine {
 public:
  /// `unit`: what is counted, in the plural.
  explicit ProgressLine(std::string unit);
  /// Ends the line, so that what follows has one of its own.
  ~ProgressLine();

  /// `done` of `total`, of which `found` cost no time.
  void show(std::uint64_t found, std::uint64_t done, std::uint64_t total);

 private:
  using Clock = std::chrono::steady_clock;

  std::string unit_;
  bool is_terminal_;
  bool shown_ = false;
  Clock::time_point start_ = Clock::now(), last_{};
};

/// "48 s", "49 min", "2 h 05 min".
std::string duration_text(double seconds);

}  // namespace jostle::services
