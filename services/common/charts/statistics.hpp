#pragma once
/// \file
/// What a handful of measurements says, without assuming how they are spread.

#include <limits>
#include <string>
#include <vector>

namespace jostle::common {

/// A number that nobody measured: tables show `-` for it, and JSON has null.
inline constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

struct Interval {
  double low = kNone, high = kNone;
};

/// Returns the value that a fraction p in [0, 1] of the values lies below, interpolated
/// between neighbours; kNone without values.
double quantile(std::vector<double> values, double p);

inline double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

/// Says where the median of the distribution that the values are drawn from lies, with 90 %
/// confidence or more: between the smallest and the largest value while there are too
/// few (four or fewer) to be so sure. Without values there is no interval.
///
/// Source   the sign test: of n values, fewer than k lie below the median with
///          probability sum_{i<k} C(n,i)/2^n, whatever their distribution.
Interval median_interval(std::vector<double> values);

/// Mean of values with the half width of its 95 % interval (normal approximation). There is no mean without
/// values, and no interval of a single one.
struct Mean {
  int count = 0;
  double value = kNone, half_width = kNone;
};
Mean mean_of(const std::vector<double>& values);

/// Success share of n runs with its 95 % Wilson interval; without runs there is none.
struct Share {
  int successes = 0, runs = 0;
  double low = kNone, high = kNone;
};
Share wilson_interval(int successes, int runs);

/// Returns how likely a fair coin falls at least as unevenly as `a` heads and `b` tails: the two-sided sign test of
/// pairs that differ (exact McNemar); 1 without pairs.
double sign_test(int a, int b);

/// Writes a number with so many digits after the point, or its first digit if none of these is another than 0; "-" if
/// there is no number.
std::string number_text(double value, int digits);

/// Writes "12.3 ± 0.4", or "12.3" without an interval, or "-".
std::string to_text(const Mean& mean, int digits);

/// Writes "0.70 to 0.97", or "-".
std::string interval_text(double low, double high);

}  // namespace jostle::common
