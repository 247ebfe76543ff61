#include "services/common/process/nearest.hpp"

#include <algorithm>
#include <cstddef>
#include <string_view>

namespace jostle::common {
namespace {

// Damerau's distance: letters left out, too many, wrong, or two in the wrong order.
std::size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> least(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        least[i][j] = i + j;
        continue;
      }
      const std::size_t wrong = a[i - 1] == b[j - 1] ? 0 : 1;
      least[i][j] = std::min({least[i - 1][j] + 1, least[i][j - 1] + 1, least[i - 1][j - 1] + wrong});
      const bool swapped = i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1];
      if (swapped) least[i][j] = std::min(least[i][j], least[i - 2][j - 2] + 1);
    }
  }
  return least[a.size()][b.size()];
}

}  // namespace

std::string nearest(const std::vector<std::string>& words, const std::string& word) {
  // Every second letter wrong is no misspelling any more.
  std::size_t fewest = word.size() / 2 + 1;
  std::string found;
  for (const std::string& candidate : words) {
    const std::size_t needed = edits(word, candidate);
    if (needed >= fewest) continue;
    fewest = needed;
    found = candidate;
  }
  return found;
}

}  // namespace jostle::common
