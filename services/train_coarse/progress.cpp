#include "services/train_coarse/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cmath>

namespace jostle::services {

std::string duration_text(double seconds) {
  if (seconds < 90) return fmt::format("{:.0f} s", seconds);
  const long minutes = std::lround(seconds / 60);
  if (minutes < 90) return fmt::format("{} min", minutes);
  return fmt::format("{} h {:02} min", minutes / 60, minutes % 60);
}

ProgressLine::ProgressLine(std::string unit) : unit_(std::move(unit)), is_terminal_(isatty(STDERR_FILENO) == 1) {}

ProgressLine::~ProgressLine() {
  if (shown_ && is_terminal_) fmt::print(stderr, "\n");
}

void ProgressLine::show(std::uint64_t found, std::uint64_t done, std::uint64_t total) {
  const auto now = Clock::now();
  const auto pause = is_terminal_ ? std::chrono::milliseconds(500) : std::chrono::milliseconds(30'000);
  if (done < total && now - last_ < pause) return;
  last_ = now;
  const double seconds = std::chrono::duration<double>(now - start_).count();
  const double rate = seconds > 0 ? static_cast<double>(done - found) / seconds : 0.0;
  std::string line = fmt::format("{} of {} {}, {:.1f} per second", done, total, unit_, rate);
  if (done < total && rate > 0) line += fmt::format(", {} left", duration_text(static_cast<double>(total - done) / rate));
  if (is_terminal_) {
    fmt::print(stderr, "\r{:<78}", line);
  } else {
    fmt::print(stderr, "{}\n", line);
  }
  std::fflush(stderr);
  shown_ = true;
}

}  // namespace jostle::services
