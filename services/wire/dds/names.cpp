#include "services/wire/dds/names.hpp"

#include <fmt/format.h>

#include <regex>

namespace jostle::wire {
namespace {

constexpr std::size_t kLongest = 64;  // characters: names of topics and claims have room for that

}  // namespace

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

// The rules of design.ros2.org, "Topic and Service Names"; those for a whole topic give the rest.
Result<std::string> parse_namespace(const std::string& text) {
  static const std::regex rule("/?([A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)");
  const auto wrong = [&](const std::string& wanted) {
    return Error{Code::kInvalidArgument, fmt::format("namespace: got '{}', wanted {}", text, wanted)};
  };
  if (text.empty()) return std::string();
  std::smatch parts;
  if (text.size() > kLongest) return wrong(fmt::format("at most {} characters", kLongest));
  if (!std::regex_match(text, parts, rule) || text.find("__") != std::string::npos) {
    return wrong("words of letters, digits and single underscores, with a slash between, such as left or lab/left");
  }
  const std::string space = parts[1];
  const std::string first = space.substr(0, space.find('/'));
  if (first == "pool" || first == "doctor") return wrong("another first word: everybody's topics have this one");
  return space;
}

std::string in_namespace(const std::string& space, const std::string& topic) {
  // Of topics, and of requests and replies of services.
  for (const std::string_view root : {std::string_view("rt/"), std::string_view("rq/"), std::string_view("rr/")}) {
    if (!space.empty() && topic.starts_with(root))
      return fmt::format("{}{}/{}", root, space, topic.substr(root.size()));
  }
  return topic;
}

}  // namespace jostle::wire
