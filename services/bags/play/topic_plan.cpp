#include "services/bags/play/topic_plan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <string_view>

#include "services/bags/format/definitions.hpp"
#include "services/wire/dds/names.hpp"
#include "services/wire/dds/system_topics.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::bags {
namespace {

// Topics of ROS 2 packages end in these where they command.
constexpr std::array<std::string_view, 12> kCommandWords{
    "command", "commands",         "cmd",     "cmd_vel",     "cmd_vel_stamped", "goal", "goal_pose",
    "cancel",  "joint_trajectory", "trigger", "initialpose", "emergency_stop"};

// Whole packages end in a slash.
constexpr std::array<std::string_view, 7> kCommandTypes{"jostle_msgs/msg/VelocityCommand",
                                                        "jostle_msgs/msg/Goal",
                                                        "jostle_msgs/msg/Cancel",
                                                        "trajectory_msgs/msg/",
                                                        "geometry_msgs/msg/Twist",
                                                        "geometry_msgs/msg/TwistStamped",
                                                        "control_msgs/msg/"};

std::string last_word(const std::string& topic) { return topic.substr(topic.rfind('/') + 1); }

// Whoever wrote the bag may have used names of the wire, or short ones.
Topic as_ros_names_it(Topic topic) {
  topic.name = ros_topic_name(topic.name);
  topic.type = ros_type_name(topic.type);
  return topic;
}

std::string names_of(const BagInfo& bag) {
  std::string names;
  for (const auto& info : bag.topics) names += (names.empty() ? "" : ", ") + ros_topic_name(info.topic.name);
  return names.empty() ? "none" : names;
}

bool is_state(const Topic& topic) {
  if (topic.qos.latched) return true;
  return std::ranges::any_of(wire::system_topics(), [&](const wire::SystemTopic& known) {
    return known.qos == kState && topic.name.ends_with(wire::ros_topic(known.name).value_or("/?")) &&
           wire::wire_type(topic.type) == known.type;
  });
}

bool is_named(const TopicChoice& choice, const std::string& topic) {
  return std::ranges::count(choice.selection.topics, topic) > 0 ||
         std::ranges::any_of(choice.remaps, [&](const auto& remap) { return remap.first == topic; });
}

std::string played_name(const TopicChoice& choice, const std::string& topic) {
  for (const auto& [from, to] : choice.remaps) {
    if (from == topic) return to;
  }
  return topic;
}

// Why a topic cannot be played, if so.
std::optional<std::string> hindrance(const TopicChoice& choice, const Topic& topic, const std::string& name) {
  if (topic.encoding != "cdr") return fmt::format("its messages are encoded as '{}', wanted 'cdr'", topic.encoding);
  const auto type = wire::wire_type(topic.type);
  if (!type) return fmt::format("its type {} is no ROS 2 message", topic.type);
  if (name.starts_with("/play/") || topic.type.starts_with("jostle_msgs/msg/Play")) return "this playback has its own";
  if (choice.with_clock && name == wire::ros_topic(wire::topics::kClock.name)) return "--clock publishes it";
  return {};
}

}  // namespace

Result<std::pair<std::string, std::string>> parse_remap(const std::string& text) {
  const std::size_t middle = text.find(":=");
  if (middle != std::string::npos) {
    std::pair remap{text.substr(0, middle), text.substr(middle + 2)};
    const auto is_topic = [](const std::string& name) {
      return name.size() > 1 && name.front() == '/' && name.back() != '/';
    };
    if (is_topic(remap.first) && is_topic(remap.second)) return remap;
  }
  return Error{Code::kInvalidArgument, fmt::format("--remap: got '{}', wanted /FROM:=/TO", text)};
}

bool commands_somebody(const Topic& topic) {
  for (const std::string& own :
       {wire::topics::kRobotCommand.name, wire::topics::kTaskGoal.name, wire::topics::kTaskCancel.name}) {
    if (topic.name.ends_with(wire::ros_topic(own).value_or("/?"))) return true;  // in a namespace or not
  }
  return topic.name.starts_with("/pool/") || topic.name.find("/_action/") != std::string::npos ||
         std::ranges::count(kCommandWords, last_word(topic.name)) > 0 ||
         std::ranges::any_of(kCommandTypes, [&](std::string_view type) {
           return type.ends_with('/') ? topic.type.starts_with(type) : topic.type == type;
         });
}

Result<TopicPlan> plan_topics(const BagInfo& bag, const TopicChoice& choice) {
  std::vector<Topic> topics;
  for (const TopicInfo& info : bag.topics) topics.push_back(as_ros_names_it(info.topic));
  for (const auto& [from, to] : choice.remaps) {
    if (std::ranges::count(topics, from, &Topic::name) > 0) continue;
    return Error{Code::kInvalidArgument,
                 fmt::format("--remap: {} has no topic {}; it has {}", bag.path.string(), from, names_of(bag))};
  }
  TopicPlan plan;
  std::map<std::string, std::string> types;  // by name when played
  for (std::size_t i = 0; i < bag.topics.size(); ++i) {
    const Topic& topic = topics[i];
    if (!choice.selection.wants(topic.name)) continue;
    const std::string name = played_name(choice, topic.name);
    if (commands_somebody(topic) && !is_named(choice, topic.name)) {
      plan.commands.push_back(topic.name);
      continue;
    }
    if (const auto reason = hindrance(choice, topic, name)) {
      plan.impossible.push_back(fmt::format("{}: {}", topic.name, *reason));
      continue;
    }
    const auto [known, is_new] = types.try_emplace(name, topic.type);
    if (!is_new && known->second != topic.type) {
      // The user's own doing, or the bag's.
      if (name != topic.name) {
        return Error{Code::kInvalidArgument,
                     fmt::format("--remap: {}: got types {} and {}, wanted one", name, known->second, topic.type)};
      }
      plan.impossible.push_back(fmt::format("{}: got a second type {}, played is {}; remedy: --remap", topic.name,
                                            topic.type, known->second));
      continue;
    }
    plan.played.push_back({.topic = static_cast<int>(i),
                           .name = name,
                           .wire = {wire::wire_topic(name), *wire::wire_type(topic.type), topic.qos},
                           .is_state = is_state(topic)});
  }
  if (!plan.played.empty()) return plan;
  std::string reason = fmt::format("{}: no topic to play; it has {}", bag.path.string(), names_of(bag));
  if (!plan.commands.empty())
    reason += fmt::format("; {} commands somebody and must be named in full", plan.commands.front());
  if (!plan.impossible.empty()) reason += "; " + plan.impossible.front();
  return Error{Code::kInvalidArgument, reason};
}

}  // namespace jostle::bags
