#include "services/dds/names.hpp"

#include <regex>

namespace jostle::dds {

std::string wire_topic(const std::string& ros_topic) { return "rt" + ros_topic; }

std::optional<std::string> ros_topic(const std::string& wire_topic) {
  if (!wire_topic.starts_with("rt/")) return {};
  return wire_topic.substr(2);
}

std::optional<std::string> wire_type(const std::string& ros_type) {
  static const std::regex form("(\\w+)/msg/(\\w+)");
  std::smatch match;
  if (!std::regex_match(ros_type, match, form)) return {};
  return match.str(1) + "::msg::dds_::" + match.str(2) + "_";
}

std::optional<std::string> ros_type(const std::string& wire_type) {
  static const std::regex form("(\\w+)::msg::dds_::(\\w+)_");
  std::smatch match;
  if (!std::regex_match(wire_type, match, form)) return {};
  return match.str(1) + "/msg/" + match.str(2);
}

}  // namespace jostle::dds
