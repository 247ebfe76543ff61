#pragma once
/// \file
/// The word that was meant.

#include <cstddef>
#include <string>
#include <string_view>

namespace jostle {

/// Returns how many edits make one word of another: a letter put in, left out or changed, or two neighbours in the
/// wrong order. The restricted distance of F. Damerau, A technique for computer detection and correction of spelling
/// errors, 1964.
std::size_t edits(std::string_view a, std::string_view b);

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

/// Returns "; did you mean WORD?" for the end of a complaint, or nothing.
template <class Words>
std::string did_you_mean(std::string_view word, const Words& known) {
  const std::string meant = nearest(word, known);
  return meant.empty() ? "" : "; did you mean " + meant + "?";
}

}  // namespace jostle
