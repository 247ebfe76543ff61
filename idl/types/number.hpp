#pragma once
/// \file
/// Whole numbers as people write them.

#include <charconv>
#include <optional>
#include <string_view>

namespace jostle {

/// Reads all of `text` as a whole number; nothing unless it lies from `least` to `most`. A minus is allowed, a plus
/// and blanks are not.
template <class Integer>
std::optional<Integer> parse_whole(std::string_view text, Integer least, Integer most) {
  Integer number{};
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (problem != std::errc{} || end != text.data() + text.size() || number < least || number > most) return {};
  return number;
}

}  // namespace jostle
