#pragma once
/// \file
/// Tags on paper, in true size.

#include <span>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "perception/camera/image.hpp"

namespace jostle::perception {

/// A tag to be printed.
struct PrintedTag {
  int id = 0;
  double size = 0.0;  ///< m, outer edge of the black border
  std::string label;  ///< ASCII, below it
};

struct Paper {
  double width = 0.210, height = 0.297;  ///< m; A4
  double margin = 0.010;                 ///< m, where printers do not print
};

/// A tag on a page.
struct PlacedTag {
  PrintedTag tag;
  double x = 0.0, y = 0.0;  ///< m, top left corner of its white margin, from the page's
};
using Page = std::vector<PlacedTag>;

/// Lays tags out in rows, in their order, with room for labels and for scissors.
/// Error kInvalidArgument: no tag, an id that does not exist, or a tag larger than the paper.
Result<std::vector<Page>> lay_out(std::span<const PrintedTag> tags, const Paper& paper = {});

/// Returns a PDF 1.4 of all pages: each cell a black rectangle, a thin grey line to cut along, labels, and on each page
/// a line of 100 mm to check the printer with. Print it without scaling.
std::string to_pdf(std::span<const Page> pages, const Paper& paper = {});

/// Returns one page without labels. Edges are at whole pixels: up to half a pixel off. `dots_per_metre` > 0.
GreyImage to_image(const Page& page, const Paper& paper, double dots_per_metre);

}  // namespace jostle::perception
