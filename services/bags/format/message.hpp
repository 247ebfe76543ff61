#pragma once
/// \file
/// What a bag holds: topics, and messages of them as they were on the wire.

#include <cstddef>
#include <cstdint>
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
  std::string definition;  ///< the type's, as ROS 2 messages are written down; empty if unknown

  bool operator==(const Topic&) const = default;
};

/// One sample: CDR with its four bytes of encapsulation.
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
