#include "services/bags/playback/progress.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace jostle::bags {
namespace {

constexpr std::size_t kBar = 24;  // characters

std::string bar(const Progress& progress) {
  const double length = progress.end - progress.start;
  const double share = length > 0 ? std::clamp((progress.time - progress.start) / length, 0.0, 1.0) : 1.0;
  const auto done = static_cast<std::size_t>(std::lround(share * (kBar - 1)));
  return fmt::format("[{}>{}]", std::string(done, '='), std::string(kBar - 1 - done, ' '));
}

}  // namespace

std::string progress_line(const Progress& progress, std::size_t width) {
  double total = 0.0;
  for (const auto& [topic, rate] : progress.topics) total += rate;
  std::string line = fmt::format("{} {:5.1f}/{:.1f} s  x{:g}  {}{}  {:.0f}/s", bar(progress), progress.time,
                                 progress.end, progress.rate, progress.state, progress.loop ? "  loop" : "", total);
  auto topics = progress.topics;
  std::ranges::stable_sort(topics, std::ranges::greater(), &std::pair<std::string, double>::second);
  for (const auto& [topic, rate] : topics) {
    const std::string more = fmt::format("  {} {:.0f}", topic, rate);
    if (rate <= 0 || line.size() + more.size() > width) break;
    line += more;
  }
  return line;
}

}  // namespace jostle::bags
