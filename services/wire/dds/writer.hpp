#pragma once
/// \file
/// Writer: publishes one topic.

#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "idl/types/time.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/topic.hpp"

namespace jostle::wire {

/// Everything about a writer that does not depend on its type.
///
/// Threads  safe from any thread, but not made or destroyed inside a reader's
///          callback: the middleware deadlocks (Fast DDS #849, #5433).
class WriterBase {
 public:
  /// Throws SetupError.
  WriterBase(const Participant& participant, const std::string& topic, const Qos& qos,
             eprosima::fastdds::dds::TypeSupport type);
  ~WriterBase();
  WriterBase(WriterBase&&) noexcept;
  WriterBase& operator=(WriterBase&&) noexcept;

  /// Returns the number of readers that were found and have not gone.
  int matched() const;

  /// Whether `count` readers were found by the deadline.
  bool wait_for_readers(TimePoint deadline, int count = 1) const;

  /// Returns Participant::id() of every participant that has a reader of ours; each once.
  std::vector<std::uint64_t> matched_participants() const;

  /// Whether that participant has a reader of ours. Other readers (recorders, `ros2 topic echo`)
  /// are no sign that whoever is to answer hears us.
  bool reaches(std::uint64_t participant) const;

  /// Whether every reliable reader found so far had everything by the deadline.
  bool wait_until_received(TimePoint deadline) const;

  /// Drops the samples that are kept: a late reader that asks for them gets only what is
  /// written from now on. A reader that has not received them yet misses them.
  void forget();

 protected:
  [[nodiscard]] bool write_sample(const void* data);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

template <class T>
class Writer : public WriterBase {
 public:
  Writer(const Participant& participant, const Topic<T>& topic)
      : WriterBase(participant, participant.wire_name(topic.name, topic.scope), topic.qos,
                   eprosima::fastdds::dds::TypeSupport(new Serializer<T>())) {}

  /// Sends from the calling thread, tens of microseconds for small messages.
  /// Without readers it succeeds. False: the message is lost, because the middleware had no
  /// room (more keys than the topic's Qos allows, or a profile that keeps all for a reader
  /// that does not keep up). A caller that can do without it says so with (void), and why.
  [[nodiscard]] bool write(const T& message) { return write_sample(&message); }
};

}  // namespace jostle::wire
