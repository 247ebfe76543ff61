#pragma once
/// \file
/// Lines that are as long as there is room.

#include <string>
#include <vector>

namespace jostle::common {

struct LinePart {
  std::string text;  ///< ASCII
  int rank = 0;      ///< 0: always shown; of the others the largest goes first where there is no room
};

/// Joins parts by two blanks, in their order, and leaves out the least important ones until the line is no longer than
/// `width` characters.
std::string fitted_line(std::vector<LinePart> parts, std::size_t width);

}  // namespace jostle::common
