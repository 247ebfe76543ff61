#include "services/common/results/json_text.hpp"

#include <algorithm>

namespace jostle::common {
namespace {

using nlohmann::json;

bool fits_a_line(const json& value) {
  if (value.is_primitive() || value.empty()) return true;
  return value.is_array() && std::ranges::all_of(value, [](const json& part) { return part.is_primitive(); });
}

void write(const json& value, std::size_t depth, std::string& out) {
  if (fits_a_line(value)) {
    // Names of files may be no UTF-8; hours of work must not be lost for that.
    out += value.dump(-1, ' ', false, json::error_handler_t::replace);
    return;
  }
  const std::string indent(depth + 1, ' ');
  out += value.is_array() ? "[" : "{";
  const char* separator = "\n";
  for (const auto& [key, part] : value.items()) {
    out += separator + indent;
    if (value.is_object()) out += json(key).dump(-1, ' ', false, json::error_handler_t::replace) + ": ";
    write(part, depth + 1, out);
    separator = ",\n";
  }
  out += "\n" + std::string(depth, ' ') + (value.is_array() ? "]" : "}");
}

}  // namespace

std::string json_text(const json& value) {
  std::string out;
  write(value, 0, out);
  return out;
}

}  // namespace jostle::common
