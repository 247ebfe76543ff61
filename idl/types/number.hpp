#pragma once
/// \file
/// Numbers as people write them, on command lines and in files. They are decimal: 050 is fifty, and 0x10, 1_000, inf
/// and nan are no numbers.

#include <charconv>
#include <cmath>
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

/// Reads all of `text` as a finite number such as 5, -0.5, .5, 5. or 1e-3; nothing if it is none, or larger than a
/// double can be. A plus and blanks are not allowed.
inline std::optional<double> parse_number(std::string_view text) {
  double number = 0.0;
  const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (problem != std::errc{} || end != text.data() + text.size() || !std::isfinite(number)) return {};
  return number;
}

/// Takes a plus off the front of a number: "+5" becomes "5", "+-5" and "+" stay what they are.
inline std::string_view without_plus(std::string_view text) {
  const bool has_plus = text.size() > 1 && text[0] == '+' && text[1] != '-' && text[1] != '+';
  return has_plus ? text.substr(1) : text;
}

}  // namespace jostle
