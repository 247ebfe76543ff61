#include "services/bags/replay/changes.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <charconv>
#include <sstream>

namespace jostle::bags {
namespace {

Error unwanted(const std::string& key, const std::string& got, const char* wanted) {
  return {Code::kInvalidArgument, fmt::format("--set {}: got '{}', wanted {}", key, got, wanted)};
}

std::string text_of(const YAML::Node& node) {
  if (!node.IsDefined() || node.IsNull()) return "not set (default)";
  YAML::Emitter out;
  out << YAML::Flow << node;
  return out.c_str();
}

// Sets the value of a dotted key; says what it was.
std::string set(YAML::Node root, const std::string& key, const YAML::Node& value) {
  std::istringstream in(key);
  std::vector<std::string> words;
  for (std::string word; std::getline(in, word, '.');) words.push_back(word);
  YAML::Node node = root;
  for (std::size_t i = 0; i + 1 < words.size(); ++i) node.reset(node[words[i]]);
  const std::string before = text_of(node[words.back()]);
  node[words.back()] = value;
  return before;
}

Result<Change> set_parameter(const std::string& key, const std::string& value, jostle_msgs::msg::Goal& goal) {
  try {
    YAML::Node root = YAML::Load(goal.parameters());
    if (!root.IsMap()) root = YAML::Node(YAML::NodeType::Map);
    const YAML::Node node = YAML::Load(value);
    Change change{.key = key, .recorded = set(root, key, node), .replayed = text_of(node)};
    YAML::Emitter out;
    out.SetDoublePrecision(17);
    out << root;
    goal.parameters(out.c_str());
    return change;
  } catch (const YAML::Exception& error) {
    return unwanted(key, value, "a value as in a file of parameters, such as 8 or [0.1, 0.1]");
  }
}

Result<Change> set_one(const std::string& key, const std::string& value, jostle_msgs::msg::Goal& goal) {
  if (key == "controller") {
    const Change change{key, goal.controller(), value};
    goal.controller(value);
    return change;
  }
  if (key == "predictor") {
    const Change change{key, goal.predictor(), value};
    goal.predictor(value);
    return change;
  }
  if (key == "seed") {
    std::uint64_t seed = 0;
    const auto [end, problem] = std::from_chars(value.data(), value.data() + value.size(), seed);
    if (problem != std::errc{} || end != value.data() + value.size()) return unwanted(key, value, "a whole number");
    const Change change{key, std::to_string(goal.seed()), value};
    goal.seed(seed);
    return change;
  }
  if (key == "plan_only") {
    if (value != "true" && value != "false") return unwanted(key, value, "true or false");
    const Change change{key, goal.plan_only() ? "true" : "false", value};
    goal.plan_only(value == "true");
    return change;
  }
  return set_parameter(key, value, goal);
}

}  // namespace

Result<std::vector<Change>> apply_changes(const std::vector<std::string>& settings, jostle_msgs::msg::Goal& goal) {
  std::vector<Change> changes;
  for (const std::string& setting : settings) {
    const auto equals = setting.find('=');
    if (equals == std::string::npos || equals == 0 || equals + 1 == setting.size()) {
      return Error{Code::kInvalidArgument,
                   fmt::format("--set: got '{}', wanted KEY=VALUE such as planner.rollouts=4 or seed=2", setting)};
    }
    auto change_result = set_one(setting.substr(0, equals), setting.substr(equals + 1), goal);
    if (!change_result) return change_result.error();
    if (change_result->recorded != change_result->replayed) changes.push_back(std::move(change_result).value());
  }
  return changes;
}

}  // namespace jostle::bags
