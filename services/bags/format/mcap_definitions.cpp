#include "services/bags/format/mcap_definitions.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "services/bags/format/mcap_file.hpp"
#include "services/bags/format/qos_text.hpp"

namespace jostle::bags::mcap {

Topic topic_of(const Channel& channel, const Schema* schema) {
  Topic topic{.name = channel.topic, .encoding = channel.encoding, .metadata = channel.metadata};
  if (schema != nullptr) {
    topic.type = schema->name;
    topic.definition = schema->data;
    // Without an encoding there is no definition, whatever the bytes.
    if (!schema->encoding.empty()) topic.schema = schema->encoding;
    topic.has_no_fields = schema->encoding == kSchemaEncoding && schema->data.empty();
  }
  if (const auto qos = topic.metadata.find(kQosKey); qos != topic.metadata.end()) {
    topic.qos = parse_qos(qos->second);
    topic.metadata.erase(qos);
  }
  return topic;
}

// Several channels may be one topic: several writers, or a recording that was merged.
int Definitions::topic_for(const Channel& channel, const Schema* schema) {
  Topic topic = mcap::topic_of(channel, schema);
  std::vector<int>& same_name = by_name_[topic.name];
  const auto known = std::ranges::find_if(
      same_name, [&](int index) { return topics_[static_cast<std::size_t>(index)].topic.is_same_as(topic); });
  if (known != same_name.end()) return *known;
  same_name.push_back(static_cast<int>(topics_.size()));
  topics_.push_back({.topic = std::move(topic)});
  return same_name.back();
}

void Definitions::take(Op op, View body, const Position& at, const std::string& where, Findings& findings) {
  if (op == Op::kSchema) {
    auto schema = parse_schema(body);
    if (!schema) return findings.lost(Part::kSchema, "malformed", where);
    const Schema* before = schemas_.at(schema->id, at);
    if (before != nullptr && !(*before == *schema)) {
      findings.flawed(Part::kSchema,
                      fmt::format("number {}: got {}, wanted {} as before, or another number", schema->id, schema->name,
                                  before->name == schema->name ? "another text" : before->name),
                      where);
    }
    schemas_.set(schema->id, at, std::move(*schema));
    return;
  }
  const auto channel = parse_channel(body);
  if (!channel) return findings.lost(Part::kTopic, "malformed", where);
  const Schema* schema = schemas_.at(channel->schema, at);
  if (channel->schema != 0 && schema == nullptr) {
    findings.flawed(Part::kTopic,
                    fmt::format("{}: got schema {}, wanted one that the file has: its type is unknown", channel->topic,
                                channel->schema),
                    where);
  }
  const int topic = topic_for(*channel, schema);
  const int* before = channels_.at(channel->id, at);
  if (before != nullptr && *before != topic) {
    const std::string& other = topics_[static_cast<std::size_t>(*before)].topic.name;
    findings.flawed(Part::kTopic,
                    fmt::format("channel {}: got {}, wanted {} as before, or another number", channel->id,
                                channel->topic, other == channel->topic ? "another type of it" : other),
                    where);
  }
  channels_.set(channel->id, at, topic);
}

Definitions Definitions::of_summary() const {
  Definitions summary = *this;
  summary.schemas_.forget_data();
  summary.channels_.forget_data();
  for (TopicInfo& topic : summary.topics_) topic.messages = 0;
  return summary;
}

bool Definitions::take_from_summary(Op op, View body) {
  if (op == Op::kSchema) {
    auto schema = parse_schema(body);
    if (!schema) return false;
    const std::uint16_t id = schema->id;
    schemas_.set_in_summary(id, std::move(*schema));
    return true;
  }
  const auto channel = parse_channel(body);
  if (!channel) return false;
  const Schema* schema = schemas_.in_summary(channel->schema);
  if (channel->schema != 0 && schema == nullptr) return false;
  channels_.set_in_summary(channel->id, topic_for(*channel, schema));
  return true;
}

}  // namespace jostle::bags::mcap
