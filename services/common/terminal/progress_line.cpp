#include "services/common/terminal/progress_line.hpp"

#include <algorithm>
#include <cmath>

namespace jostle::common {
namespace {

using namespace std::chrono_literals;

double rate(std::uint64_t made, double seconds) { return seconds > 0 ? static_cast<double>(made) / seconds : 0.0; }

}  // namespace

ProgressLine::ProgressLine(ProgressLineOptions options)
    : options_(std::move(options)), line_(options_.doing, options_.plain) {}

ProgressLine::~ProgressLine() {
  if (options_.wiped) line_.wipe();
}

void ProgressLine::show(std::uint64_t done, std::uint64_t total, std::uint64_t found) {
  if (!line_.visible() || (done < next_look_ && done != total)) return;
  const auto now = Clock::now();
  const double seconds = std::chrono::duration<double>(now - start_).count();
  // A look at the clock costs as much as a small message: about a hundred per second are enough,
  // and a thousand messages without one are few even if they become slow.
  next_look_ = done + static_cast<std::uint64_t>(std::min(0.01 * rate(done - found, seconds), 1000.0));
  if (now < next_ && done != total) return;
  next_ = now + (line_.live() ? 250ms : 30s);
  line_.draw(fmt::format("{}: {}", options_.doing, progress_text(options_.unit, done, total, seconds, found)));
}

std::string progress_text(std::string_view unit, std::uint64_t done, std::uint64_t total, double seconds,
                          std::uint64_t found) {
  // A damaged bag may hold more than it says.
  const std::uint64_t percent = done < total ? done * 100 / total : 100;
  const double per_second = rate(done - found, seconds);
  std::string text = fmt::format("{} of {} {} ({} %)", done, total, unit, percent);
  if (per_second > 0) text += fmt::format(", {:.1f} per second", per_second);
  if (per_second > 0 && done < total)
    text += fmt::format(", {} left", duration_text(static_cast<double>(total - done) / per_second));
  return text;
}

std::string duration_text(double seconds) {
  if (seconds < 90) return fmt::format("{:.0f} s", seconds);
  const long minutes = std::lround(seconds / 60);
  if (minutes < 90) return fmt::format("{} min", minutes);
  return fmt::format("{} h {:02} min", minutes / 60, minutes % 60);
}

}  // namespace jostle::common
