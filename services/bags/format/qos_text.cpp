#include "services/bags/format/qos_text.hpp"

#include <fmt/format.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>

namespace jostle::bags {
namespace {

// Source: rmw/types.h. Time without end, as rmw has it.
constexpr const char* kForever = "\n    sec: 9223372036\n    nsec: 854775807";

bool is_one_of(const YAML::Node& node, const char* number, const char* name) {
  const auto text = node.as<std::string>("");
  return text == number || text == name;
}

}  // namespace

std::string qos_text(const Qos& qos) {
  std::string text = fmt::format(
      "- history: 1\n  depth: {}\n  reliability: {}\n  durability: {}\n  deadline:{}\n  lifespan:{}\n"
      "  liveliness: 1\n  liveliness_lease_duration:{}\n  avoid_ros_namespace_conventions: false",
      qos.depth, qos.reliable ? 1 : 2, qos.latched || qos.retained ? 1 : 2, kForever, kForever, kForever);
  if (qos.retained) text += "\n  retained: true";
  if (qos.instances != Qos{}.instances) text += fmt::format("\n  instances: {}", qos.instances);
  return text;
}

Qos parse_qos(const std::string& text) {
  Qos qos;
  try {
    const YAML::Node profiles = YAML::Load(text);
    if (!profiles.IsSequence() || profiles.size() == 0) return qos;
    qos = {.latched = true, .depth = 0};
    for (const YAML::Node& profile : profiles) {
      if (is_one_of(profile["reliability"], "2", "best_effort")) qos.reliable = false;
      if (!is_one_of(profile["durability"], "1", "transient_local")) qos.latched = false;
      qos.depth = std::max(qos.depth, profile["depth"].as<int>(0));
      qos.instances = std::max(qos.instances, profile["instances"].as<int>(1));
      qos.retained = profile["retained"].as<bool>(false);
    }
    if (qos.retained) qos.latched = false;
    if (qos.depth <= 0) qos.depth = Qos{}.depth;  // unknown: discovery does not tell
    return qos;
  } catch (const YAML::Exception&) {
    return {};
  }
}

}  // namespace jostle::bags
