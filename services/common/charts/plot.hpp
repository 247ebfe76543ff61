#pragma once
/// \file
/// Line charts with bands, drawn by gnuplot.

#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/common/charts/gnuplot.hpp"

namespace jostle::common {

/// A line and, around it, where the values lie. A value that is not finite leaves a gap; so a band whose `low` and
/// `high` are not finite is a line alone.
struct Band {
  std::string name;
  std::vector<double> x, low, middle, high;  ///< equally many
};

struct Panel {
  std::string x_label, y_label;
  bool log_x = false, log_y = false;
  std::vector<Band> bands;  ///< the same names in the same order in every panel of a picture
  /// Whether x counts something: then ticks stand at whole numbers only, and every value has a mark.
  bool counts_x = false;
  /// What x = 0, 1, 2, … are called, if x is no number: then values are marks with error bars instead of lines.
  /// A picture whose panels all have names needs no legend and has none.
  std::vector<std::string> names;
  /// A logarithmic axis has no place for a y of 0. Such values stand on a line at the bottom, which is called this.
  std::string zero = "0";
};

/// Draws panels side by side under one title, with one legend beside them, as a PNG, SVG or PDF: the file's ending says
/// which. Margins grow with what stands in them. Colours are those of Okabe and Ito, "Color Universal Design",
/// 2008, which colour-blind eyes can tell apart; marks and dashes help where colours do not suffice.
/// Errors   kInvalidArgument  another ending, nothing to draw, or a band's sizes disagree
///          kNotFound         gnuplot is not installed
///          kIo               the file cannot be written; gnuplot's own words
Result<void> plot(const std::filesystem::path& picture, const std::string& title, const std::vector<Panel>& panels);

}  // namespace jostle::common
