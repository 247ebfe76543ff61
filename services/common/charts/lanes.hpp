#pragma once
/// \file
/// Bars in lanes over time, drawn by gnuplot.

#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/common/charts/gnuplot.hpp"

namespace jostle::common {

struct LaneChart {
  struct Bar {
    int lane = 0, series = 0;
    double from = 0.0, to = 0.0;
    bool hatched = false;
  };

  std::string title, x_label;
  std::vector<std::string> lanes;   ///< top to bottom
  std::vector<std::string> series;  ///< as the legend names them, a colour each; the eighth has the first's again
  std::string hatched;              ///< what hatched bars are; empty: not in the legend
  double length = 0.0;              ///< a lane's, in units of x; where no bar is, its ground shows
  std::vector<Bar> bars;
};

/// Draws a PNG, SVG or PDF, as the ending of the file's name says.
/// Errors   kInvalidArgument  another ending, no lanes, a length that is not positive, or
///                            a bar in no lane or series
///          kNotFound, kIo    see run_gnuplot
Result<void> draw(const std::filesystem::path& picture, const LaneChart& chart);

}  // namespace jostle::common
