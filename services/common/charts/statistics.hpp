#pragma once
/// \file
/// What a handful of measurements says, without assuming how they are spread.

#include <vector>

namespace jostle::common {

struct Interval {
  double low = 0.0, high = 0.0;
};

/// Returns the value that a fraction p in [0, 1] of the values lies below, interpolated
/// between neighbours; values must not be empty.
double quantile(std::vector<double> values, double p);

inline double median(std::vector<double> values) { return quantile(std::move(values), 0.5); }

/// Says where the median of the distribution that the values are drawn from lies, with 90 %
/// confidence or more: between the smallest and the largest value while there are too
/// few (four or fewer) to be so sure. values must not be empty.
///
/// Source   the sign test: of n values, fewer than k lie below the median with
///          probability sum_{i<k} C(n,i)/2^n, whatever their distribution.
Interval median_interval(std::vector<double> values);

/// Mean of values with the half width of its 95 % interval (normal approximation); 0
/// without values.
struct Mean {
  double value = 0.0, half_width = 0.0;
};
Mean mean_of(const std::vector<double>& values);

/// Success share of n runs with its 95 % Wilson interval.
struct Share {
  int successes = 0, runs = 0;
  double low = 0.0, high = 1.0;
};
Share wilson_interval(int successes, int runs);

}  // namespace jostle::common
