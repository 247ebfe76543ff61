#pragma once
/// \file
/// JSON as people and diffs read it.

#include <nlohmann/json.hpp>
#include <string>

namespace jostle::common {

/// Returns JSON with a line for each key, and one for each list of numbers or texts: a state, a control. Lists of such
/// lists have one per line.
std::string json_text(const nlohmann::json& value);

}  // namespace jostle::common
