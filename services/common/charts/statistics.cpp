#include "services/common/charts/statistics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace jostle::common {
namespace {

constexpr double kTail = 0.05;  // each side of a 90 % interval

// P(i of n fair coins show heads).
double binomial(double n, double i) {
  return std::exp(std::lgamma(n + 1) - std::lgamma(i + 1) - std::lgamma(n - i + 1) - n * std::log(2.0));
}

}  // namespace

double quantile(std::vector<double> values, double p) {
  if (values.empty()) return kNone;
  std::ranges::sort(values);
  const double place = p * static_cast<double>(values.size() - 1);
  const auto below = static_cast<std::size_t>(place);
  const std::size_t above = std::min(below + 1, values.size() - 1);
  return std::lerp(values[below], values[above], place - static_cast<double>(below));
}

Interval median_interval(std::vector<double> values) {
  if (values.empty()) return {};
  std::ranges::sort(values);
  const std::size_t n = values.size();
  std::size_t outside = 0;  // values left out on each side
  double tail = binomial(static_cast<double>(n), 0);
  while (2 * (outside + 1) < n) {
    tail += binomial(static_cast<double>(n), static_cast<double>(outside + 1));
    if (tail > kTail) break;
    ++outside;
  }
  return {values[outside], values[n - 1 - outside]};
}

double sign_test(int a, int b) {
  double tail = 0.0;
  for (int i = 0; i <= std::min(a, b); ++i) tail += binomial(a + b, i);
  return std::min(2 * tail, 1.0);
}

Mean mean_of(const std::vector<double>& values) {
  if (values.empty()) return {};
  const auto n = static_cast<double>(values.size());
  double sum = 0.0, squares = 0.0;
  for (const double value : values) sum += value;
  for (const double value : values) squares += (value - sum / n) * (value - sum / n);
  const double half_width = n > 1 ? 1.96 * std::sqrt(squares / (n - 1) / n) : kNone;
  return {.count = static_cast<int>(values.size()), .value = sum / n, .half_width = half_width};
}

Share wilson_interval(int successes, int runs) {
  if (runs == 0) return {};
  constexpr double z = 1.959964;  // 95 %
  const double n = runs, p = successes / n;
  const double centre = (p + z * z / (2 * n)) / (1 + z * z / n);
  const double half = z / (1 + z * z / n) * std::sqrt(p * (1 - p) / n + z * z / (4 * n * n));
  // If none or all succeed, a bound is 0 or 1, but for rounding.
  return {
      .successes = successes, .runs = runs, .low = std::max(centre - half, 0.0), .high = std::min(centre + half, 1.0)};
}

std::string number_text(double value, int digits) {
  if (!std::isfinite(value)) return "-";
  const bool is_lost = value != 0 && std::abs(value) < 0.5 * std::pow(10, -digits);  // would be written as 0
  return is_lost ? fmt::format("{:.1g}", value) : fmt::format("{:.{}f}", value, digits);
}

std::string to_text(const Mean& mean, int digits) {
  if (!std::isfinite(mean.half_width)) return number_text(mean.value, digits);
  return number_text(mean.value, digits) + " ± " + number_text(mean.half_width, digits);
}

std::string interval_text(double low, double high) {
  if (!std::isfinite(low) || !std::isfinite(high)) return "-";
  return number_text(low, 2) + " to " + number_text(high, 2);
}

}  // namespace jostle::common
