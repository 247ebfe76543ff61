#pragma once
/// \file
/// Where an axis begins and ends, and where its ticks stand.

#include <string>
#include <utility>
#include <vector>

namespace jostle::common {

struct Axis {
  double low = 0.0, high = 1.0;
  bool logarithmic = false;
  std::vector<std::pair<double, std::string>> ticks;  ///< ascending, within the range
  double zero = 0.0;                                  ///< logarithmic: where values of 0 are drawn; 0: there are none

  /// Where a value is drawn: what lies below a logarithmic axis is drawn at its end.
  double place(double value) const;
};

/// Makes an axis from the lowest to the highest value, both rounded outward to ticks. Values that are not finite do not
/// count; without any other the axis goes from 0 to 1.
Axis linear_axis(const std::vector<double>& values);

/// Makes an axis of whole numbers, with ticks at whole numbers only and a little room at both ends.
Axis counting_axis(const std::vector<double>& values);

/// Makes an axis of names at 0, 1, 2, …, with room for half of one at both ends.
Axis naming_axis(const std::vector<std::string>& names);

/// Makes a logarithmic axis, not rounded to whole decades, with as many ticks per decade as have room. If values of 0
/// are among `values`, a line for them called `zero` stands below all others. `bounds` widen the axis upward, and
/// downward by a decade at most.
Axis logarithmic_axis(const std::vector<double>& values, const std::vector<double>& bounds, const std::string& zero);

}  // namespace jostle::common
