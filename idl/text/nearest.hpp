#pragma once
/// \file
/// The word that was meant.

#include <algorithm>
#include <numeric>
#include <string>
#include <string_view>
#include <vector>

namespace jostle {

/// Returns how many letters have to be put in, left out or changed to make one word of another.
inline std::size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row.back();
}

/// Returns the known word that is nearest to `word`; empty if none is near enough to be meant. `known`: a range of
/// texts.
template <class Words>
std::string nearest(std::string_view word, const Words& known) {
  constexpr std::size_t kLongest = 64;       // letters of a word
  std::size_t fewest = word.size() / 2 + 1;  // every second letter wrong is no misspelling any more
  std::string found;
  if (word.size() > kLongest) return found;
  for (const auto& candidate : known) {
    const std::string_view text(candidate);
    if (text.size() >= word.size() + fewest) continue;
    const std::size_t needed = edits(word, text);
    if (needed >= fewest) continue;
    fewest = needed;
    found = text;
  }
  return found;
}

}  // namespace jostle
