#include "services/wire/dds/system_topics.hpp"

#include "services/wire/dds/display_topics.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::wire {
namespace {

template <class T>
SystemTopic describe(const Topic<T>& topic) {
  Serializer<T> serializer;
  return {{topic.name, serializer.getName(), topic.qos}, serializer.m_isGetKeyDefined, topic.scope};
}

}  // namespace

const std::vector<SystemTopic>& system_topics() {
  static const std::vector<SystemTopic> table =
      std::apply([](const auto&... topic) { return std::vector{describe(topic)...}; },
                 std::tuple_cat(topics::all(), topics::displayed()));
  return table;
}

}  // namespace jostle::wire
