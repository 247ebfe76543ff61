#pragma once
/// \file
/// Writers and readers of samples as they are on the wire, of types known by name only.

#include <cstddef>
#include <functional>
#include <span>
#include <string>

#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/writer.hpp"

namespace jostle::wire {

/// A topic whose samples stay serialized: CDR with its four bytes of encapsulation.
struct RawTopic {
  std::string name;  ///< as on the wire, "rt/robot/status"
  std::string type;  ///< likewise, "jostle_msgs::msg::dds_::RobotStatus_"
  Qos qos;
};

/// Whether raw writers and readers can have a type. They can have any type without a key, and those keyed
/// types of this system whose code finds the key in a sample.
bool can_be_raw(const std::string& type, bool keyed);

/// Writes samples as bytes. A participant uses a type either raw or as what it is; using both is a SetupError.
///
/// Threads  safe from any thread.
class RawWriter : public WriterBase {
 public:
  /// Throws SetupError.
  RawWriter(const Participant& participant, const RawTopic& topic);

  /// Does as Writer::write does; false also for a sample shorter than its encapsulation.
  [[nodiscard]] bool write(std::span<const std::byte> sample);
};

/// Calls back as Reader does; the bytes are gone when the callback returns.
class RawReader : public ReaderBase {
 public:
  using OnSample = std::function<void(std::span<const std::byte>, const Origin&)>;

  /// Throws SetupError.
  RawReader(const Participant& participant, const RawTopic& topic, OnSample on_sample);
};

}  // namespace jostle::wire
