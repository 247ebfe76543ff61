#pragma once
/// \file
/// What a bag holds: topics, and messages of them as they were on the wire.

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "idl/types/qos.hpp"

namespace jostle::bags {

/// Nanoseconds since the Unix epoch.
using Time = std::int64_t;

/// A topic as ROS 2 tools name it.
struct Topic {
  std::string name;        ///< "/robot/status"
  std::string type;        ///< "jostle_msgs/msg/RobotStatus"
  Qos qos;                 ///< what its writer offered
  std::string definition;  ///< the type's, written as `schema` says; empty if unknown, or if `has_no_fields`

  std::string schema = "ros2msg";               ///< how the definition is written, as MCAP names it
  bool has_no_fields = false;                   ///< the definition is known, and empty
  std::string encoding = "cdr";                 ///< of its messages, as MCAP names it
  std::map<std::string, std::string> metadata;  ///< what else its writer said of it

  bool operator==(const Topic&) const = default;

  /// Whether this is a topic's own definition as ROS 2 messages are written down.
  bool has_message_definition() const { return schema == "ros2msg" && (has_no_fields || !definition.empty()); }

  /// Whether messages of both are the same to a reader, whoever wrote them.
  bool is_same_as(const Topic& other) const {
    return name == other.name && type == other.type && definition == other.definition && schema == other.schema &&
           has_no_fields == other.has_no_fields && encoding == other.encoding;
  }
};

/// A file within a bag.
struct Attachment {
  std::string name, media_type;
  Time log_time = 0, create_time = 0;
  std::vector<std::byte> data;
};

/// One sample: with CDR, the four bytes of encapsulation included.
struct MessageView {
  Time log_time = 0;           ///< when the recorder got it
  Time publish_time = 0;       ///< when its writer sent it
  std::uint32_t sequence = 0;  ///< counts the topic's messages in this bag, from 1; 0 if unknown
  std::span<const std::byte> data;
};

/// The same with data of its own. `topic` is an index into BagInfo::topics.
struct Message {
  int topic = 0;
  Time log_time = 0;
  Time publish_time = 0;
  std::uint32_t sequence = 0;
  std::vector<std::byte> data;

  MessageView view() const { return {log_time, publish_time, sequence, data}; }
};

}  // namespace jostle::bags
