#include "services/common/terminal/fitted_line.hpp"

#include <algorithm>

namespace jostle::common {
namespace {

constexpr const char* kGap = "  ";

std::string joined(const std::vector<LinePart>& parts) {
  std::string line;
  for (const LinePart& part : parts) line += (line.empty() ? "" : kGap) + part.text;
  return line;
}

}  // namespace

std::string fitted_line(std::vector<LinePart> parts, std::size_t width) {
  std::string line = joined(parts);
  while (line.size() > width && !parts.empty()) {
    const auto least = std::ranges::max_element(parts, {}, &LinePart::rank);
    if (least->rank == 0) break;
    parts.erase(least);
    line = joined(parts);
  }
  return line;
}

}  // namespace jostle::common
