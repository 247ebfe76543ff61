#include "services/common/charts/axis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace jostle::common {
namespace {

struct Range {
  double low = 0.0, high = 0.0;
};

std::optional<Range> range_of(const std::vector<double>& values, double above = -HUGE_VAL) {
  std::optional<Range> range;
  for (const double value : values) {
    if (!std::isfinite(value) || value <= above) continue;
    if (!range) range = Range{value, value};
    range->low = std::min(range->low, value);
    range->high = std::max(range->high, value);
  }
  return range;
}

// 1, 2 or 5 times a power of ten, so that about eight of them span the range.
double round_step(double span) {
  constexpr double kTicks = 8;
  const double wanted = span / kTicks, power = std::pow(10, std::floor(std::log10(wanted)));
  for (const double factor : {1.0, 2.0, 5.0}) {
    if (factor * power >= wanted * (1 - 1e-9)) return factor * power;
  }
  return 10 * power;
}

// From the first to the last multiple of the step in a range. A number that only rounding keeps from 0 is 0.
void add_ticks(double from, double to, double step, Axis& axis) {
  const double first = std::ceil(from / step - 1e-9), last = std::floor(to / step + 1e-9);
  for (double i = first; i <= last; ++i)
    axis.ticks.emplace_back(i * step, fmt::format("{:g}", i == 0 ? 0.0 : i * step));
}

}  // namespace

double Axis::place(double value) const {
  if (logarithmic && value == 0 && zero > 0) return zero;
  return logarithmic && value < low ? low : value;
}

Axis linear_axis(const std::vector<double>& values) {
  Range range = range_of(values).value_or(Range{0.0, 1.0});
  // A constant has a place in the middle of something of its own size.
  if (range.high - range.low <= 1e-12 * std::max(std::abs(range.low), std::abs(range.high))) {
    const double around = range.low == 0 ? 1.0 : std::abs(range.low) / 2;
    range = {range.low - around, range.high + around};
  }
  const double step = round_step(range.high - range.low);
  Axis axis{.low = step * std::floor(range.low / step + 1e-9), .high = step * std::ceil(range.high / step - 1e-9)};
  add_ticks(axis.low, axis.high, step, axis);
  return axis;
}

Axis counting_axis(const std::vector<double>& values) {
  const Range range = range_of(values).value_or(Range{0.0, 1.0});
  constexpr double kRoom = 0.03;  // of the range, at each end
  const double room = range.high > range.low ? kRoom * (range.high - range.low) : 0.5;
  Axis axis{.low = range.low - room, .high = range.high + room};
  add_ticks(range.low, range.high, range.high > range.low ? std::max(1.0, round_step(range.high - range.low)) : 1.0,
            axis);
  return axis;
}

Axis naming_axis(const std::vector<std::string>& names) {
  Axis axis{.low = -0.5, .high = static_cast<double>(names.size()) - 0.5};
  for (std::size_t i = 0; i < names.size(); ++i) axis.ticks.emplace_back(static_cast<double>(i), names[i]);
  return axis;
}

Axis logarithmic_axis(const std::vector<double>& values, const std::vector<double>& bounds, const std::string& zero) {
  const bool has_zero = std::ranges::find(values, 0.0) != values.end();
  Range range = range_of(values, 0.0).value_or(Range{0.1, 1.0});
  const Range wide = range_of(bounds, 0.0).value_or(range);
  range.low = std::min(range.low, std::max(wide.low, range.low / 10));
  range.high = std::max(range.high, wide.high);
  constexpr double kMargin = 1.04;
  Axis axis{.low = range.low / kMargin, .high = range.high * kMargin, .logarithmic = true};
  if (has_zero) {
    constexpr double kRoom = 0.12;  // of the axis, between the least value and the line of zeros
    axis.zero = axis.low * std::pow(axis.high / axis.low, -kRoom);
    axis.low = axis.zero / std::pow(axis.high / axis.zero, 0.02);
    axis.ticks.emplace_back(axis.zero, zero);
  }
  const double span = range.high / range.low;
  const std::vector<int> digits = span > 1e4 ? std::vector{1}
                                  : span > 8 ? std::vector{1, 2, 5}
                                             : std::vector{1, 2, 3, 4, 5, 6, 7, 8, 9};
  const int decades = static_cast<int>(std::ceil(std::log10(span))) + 1, every = span > 1e4 ? (decades + 8) / 9 : 1;
  const int first = static_cast<int>(std::floor(std::log10(range.low)));
  for (int decade = first; std::pow(10, decade) <= axis.high; decade += every) {
    for (const int digit : digits) {
      const double value = digit * std::pow(10, decade);
      if (value >= range.low / kMargin && value <= axis.high)
        axis.ticks.emplace_back(value, fmt::format("{:g}", value));
    }
  }
  return axis;
}

}  // namespace jostle::common
