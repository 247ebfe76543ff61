#pragma once
/// \file
/// Whole numbers as people write them.

#include <charconv>
#include <optional>
#include <string_view>

namespace jostle {

/// The number that all of `text` is, if it lies from `least` to `most`: no sign but a minus, no blanks.
template <class Integer>
std::optional<Integer> parse_whole(std::string_view text, Integer least, Integer most) {
  Integer number{};
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (problem != std::errc{} || end != text.data() + text.size() || number < least || number > most) return {};
  return number;
}

}  // namespace jostle
