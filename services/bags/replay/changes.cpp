#include "services/bags/replay/changes.hpp"

#include <fmt/format.h>

#include <charconv>
#include <optional>

#include "services/task/config/parameter_keys.hpp"

namespace jostle::bags {
namespace {

Error unwanted(const std::string& key, const std::string& got, const char* wanted) {
  return {Code::kInvalidArgument, fmt::format("--set {}: got '{}', wanted {}", key, got, wanted)};
}

// Sets one of the options that are not parameters; nothing if it is none of them.
Result<std::optional<Change>> set_option(const std::string& key, const std::string& value,
                                         jostle_msgs::msg::Goal& goal) {
  if (key == "controller") {
    const Change change{key, goal.controller(), value};
    goal.controller(value);
    return std::optional(change);
  }
  if (key == "predictor") {
    const Change change{key, goal.predictor(), value};
    goal.predictor(value);
    return std::optional(change);
  }
  if (key == "seed") {
    std::uint64_t seed = 0;
    const auto [end, problem] = std::from_chars(value.data(), value.data() + value.size(), seed);
    if (problem != std::errc{} || end != value.data() + value.size()) return unwanted(key, value, "a whole number");
    const Change change{key, std::to_string(goal.seed()), value};
    goal.seed(seed);
    return std::optional(change);
  }
  if (key == "plan_only") {
    if (value != "true" && value != "false") return unwanted(key, value, "true or false");
    const Change change{key, goal.plan_only() ? "true" : "false", value};
    goal.plan_only(value == "true");
    return std::optional(change);
  }
  return std::optional<Change>{};
}

Result<std::vector<Change>> set_parameters(const std::vector<std::string>& settings, jostle_msgs::msg::Goal& goal) {
  auto recorded_result = task::parse_parameters(goal.parameters(), "goal.parameters");
  if (!recorded_result) return recorded_result.error();
  auto replayed_result = task::with_settings(*recorded_result, settings);
  if (!replayed_result) return replayed_result.error();
  goal.parameters(task::to_yaml(*replayed_result));
  std::vector<Change> changes;
  for (const task::ParameterDifference& difference : task::differences(*recorded_result, *replayed_result)) {
    changes.push_back({difference.key, task::to_text(difference.before), task::to_text(difference.after)});
  }
  return changes;
}

}  // namespace

Result<std::vector<Change>> apply_changes(const std::vector<std::string>& settings, jostle_msgs::msg::Goal& goal) {
  std::vector<Change> changes;
  std::vector<std::string> others;  // parameters
  for (const std::string& setting : settings) {
    const auto equals = setting.find('=');
    if (equals == std::string::npos) {
      others.push_back(setting);
      continue;
    }
    auto change_result = set_option(setting.substr(0, equals), setting.substr(equals + 1), goal);
    if (!change_result) return change_result.error();
    if (!*change_result) {
      others.push_back(setting);
    } else if (const Change& change = **change_result; change.recorded != change.replayed) {
      changes.push_back(change);
    }
  }
  if (others.empty()) return changes;
  auto others_result = set_parameters(others, goal);
  if (!others_result) return others_result.error();
  changes.insert(changes.end(), others_result->begin(), others_result->end());
  return changes;
}

}  // namespace jostle::bags
