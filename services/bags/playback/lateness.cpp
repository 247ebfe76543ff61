#include "services/bags/playback/lateness.hpp"

#include <algorithm>
#include <cmath>

namespace jostle::bags {
namespace {

constexpr double kFinest = 1000.0;  // ns: upper edge of the first bin
constexpr double kGrowth = 1.02;    // of an edge over the one before

}  // namespace

void Lateness::add(std::chrono::nanoseconds delay) {
  const double value = std::max(static_cast<double>(delay.count()), kFinest);
  const auto bin = static_cast<std::size_t>(std::ceil(std::log(value / kFinest) / std::log(kGrowth)));
  ++bins_[std::min(bin, bins_.size() - 1)];
  ++count_;
  worst_ = std::max(worst_, delay);
}

std::chrono::nanoseconds Lateness::quantile(double p) const {
  const auto wanted = static_cast<std::uint64_t>(std::ceil(p * static_cast<double>(count_)));
  std::uint64_t below = 0;
  for (std::size_t bin = 0; bin < bins_.size(); ++bin) {
    below += bins_[bin];
    if (below < wanted || below == 0) continue;
    const double edge = kFinest * std::pow(kGrowth, static_cast<double>(bin));
    return std::min(std::chrono::nanoseconds(std::llround(edge)), worst_);
  }
  return std::chrono::nanoseconds(0);
}

}  // namespace jostle::bags
