#pragma once
/// \file
/// Line charts with bands, drawn by gnuplot.

#include <filesystem>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::common {

/// A line and, around it, where the values lie. A value that is not finite leaves a gap.
struct Band {
  std::string name;
  std::vector<double> x, low, middle, high;  ///< equally many
};

struct Panel {
  std::string x_label, y_label;
  bool log_x = false, log_y = false;
  std::vector<Band> bands;  ///< the same names in the same order in every panel of a picture
};

/// Draws panels side by side under one title, with one legend beside them, as a PNG.
/// Colours are those of Okabe and Ito, "Color Universal Design", 2008, which
/// colour-blind eyes can tell apart; dashes help where eight do not suffice.
/// Errors   kInvalidArgument  nothing to draw, or a band's sizes disagree
///          kNotFound         gnuplot is not installed
///          kIo               the file cannot be written; gnuplot's own words
Result<void> plot(const std::filesystem::path& png, const std::string& title, const std::vector<Panel>& panels);

}  // namespace jostle::common
