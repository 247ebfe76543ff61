#pragma once
/// \file
/// A reader that keeps what it gets, byte for byte.

#include <mutex>
#include <string>
#include <vector>

#include "services/wire/dds/names.hpp"
#include "services/wire/dds/raw.hpp"
#include "tests/support/bags.hpp"

namespace jostle::tests {

/// Of a topic as ROS 2 names it.
class RawSubscriber {
 public:
  RawSubscriber(const wire::Participant& participant, const std::string& topic,
                const std::string& type = "std_msgs/msg/String", const Qos& qos = {.depth = kKeepAll})
      : reader_(participant, {wire::wire_topic(topic), wire::wire_type(type).value(), qos},
                [this](std::span<const std::byte> sample, const wire::Origin&) {
                  const std::lock_guard lock(mutex_);
                  samples_.emplace_back(sample.begin(), sample.end());
                }) {}

  std::vector<Bytes> samples() const {
    const std::lock_guard lock(mutex_);
    return samples_;
  }
  std::size_t count() const {
    const std::lock_guard lock(mutex_);
    return samples_.size();
  }
  /// Of std_msgs/msg/String.
  std::vector<std::string> texts() const {
    std::vector<std::string> texts;
    for (const Bytes& sample : samples()) texts.push_back(text_of(sample));
    return texts;
  }
  int matched() const { return reader_.matched(); }

 private:
  mutable std::mutex mutex_;  // guards samples_
  std::vector<Bytes> samples_;
  wire::RawReader reader_;  // last: stops before what it fills is gone
};

}  // namespace jostle::tests
