#pragma once
/// \file
/// JSON that somebody else wrote.

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "idl/types/result.hpp"

namespace jostle {

/// How deep lists and objects may lie in one another: values are copied and written by recursion, and a stack ends.
inline constexpr int kMostJsonDepth = 64;

/// Reads JSON.
/// Error kInvalidArgument: there is none, with the parser's words; or it lies deeper in itself than kMostJsonDepth.
inline Result<nlohmann::json> parse_json(std::string_view text) {
  bool is_too_deep = false;
  try {
    using Event = nlohmann::json::parse_event_t;
    nlohmann::json value = nlohmann::json::parse(text, [&](int outer, Event event, const nlohmann::json&) {
      const bool begins = event == Event::array_start || event == Event::object_start;
      is_too_deep = is_too_deep || (begins && outer >= kMostJsonDepth);
      return !is_too_deep;
    });
    if (!is_too_deep) return value;
  } catch (const nlohmann::json::exception& error) {
    return Error{Code::kInvalidArgument, std::string("not JSON: ") + error.what()};
  }
  return Error{Code::kInvalidArgument,
               "got JSON more than " + std::to_string(kMostJsonDepth) + " deep in itself, wanted less"};
}

}  // namespace jostle
