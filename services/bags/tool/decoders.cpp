#include "services/bags/tool/decoders.hpp"

#include <fmt/format.h>

namespace jostle::bags {

Decoders::Decoders(const BagInfo& info, const MessageFiles& messages) {
  for (const TopicInfo& topic : info.topics) {
    names_.push_back(topic.topic.name);
    reasons_.emplace_back();
    decoders_.emplace_back();
    earlier_.emplace_back();
    if (topic.topic.encoding != "cdr") {
      reasons_.back() =
          fmt::format("{}: got messages encoded as '{}', wanted 'cdr'", topic.topic.name, topic.topic.encoding);
      continue;
    }
    const std::string type = ros_type_name(topic.topic.type);
    const bool brings_own = topic.topic.has_message_definition();
    const Result<std::string> definition =
        brings_own ? Result<std::string>(topic.topic.definition) : messages.definition(type);
    if (!definition) {
      reasons_.back() = topic.topic.definition.empty()
                            ? fmt::format("{}: got no definition of {} in the bag, and none is known: {}",
                                          topic.topic.name, topic.topic.type, definition.error().message)
                            : fmt::format("{}: got a definition of {} written as '{}', wanted 'ros2msg'",
                                          topic.topic.name, topic.topic.type, topic.topic.schema);
      continue;
    }
    auto decoder_result = Decoder::create(type, *definition);
    if (decoder_result) {
      decoders_.back().emplace(std::move(*decoder_result));
      if (brings_own) continue;
      for (const std::string& earlier : earlier_definitions_of(type)) {
        auto earlier_result = Decoder::create(topic.topic.type, earlier);
        if (earlier_result) earlier_.back().push_back(std::move(*earlier_result));
      }
    } else {
      reasons_.back() = fmt::format("{}: {}", topic.topic.name, decoder_result.error().message);
    }
  }
}

Result<nlohmann::ordered_json> Decoders::decode(const Message& message) const {
  const auto topic = static_cast<std::size_t>(message.topic);
  auto json_result = decoders_.at(topic)->decode(message.data);
  if (json_result) return json_result;
  for (const Decoder& earlier : earlier_.at(topic)) {
    if (auto earlier_result = earlier.decode(message.data)) return earlier_result;
  }
  return Error{json_result.error().code, fmt::format("{}: message of log time {}: {}", names_[topic], message.log_time,
                                                     json_result.error().message)};
}

}  // namespace jostle::bags
