#pragma once
/// \file
/// Samples over DDS, there and back: one doctor says them, the other repeats them.

#include <atomic>
#include <chrono>
#include <cstddef>
#include <optional>
#include <string>
#include <thread>

#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"

namespace jostle::tools {

/// An Echo repeats what it hears until it is destroyed.
class Echo {
 public:
  /// Throws wire::SetupError.
  explicit Echo(const wire::Participant& participant);

  int heard() const { return heard_; }

 private:
  std::atomic<int> heard_{0};
  wire::Writer<jostle_msgs::msg::Goal> back_;
  wire::Inbox<jostle_msgs::msg::Goal> there_;
  std::jthread repeater_;  // last: ends before what it uses is gone
};

/// A Caller is the other end: it says samples and waits for them to come back.
class Caller {
 public:
  /// `session`: whose answers count. Throws wire::SetupError.
  Caller(const wire::Participant& participant, std::string session);

  /// Whether both directions found each other by the deadline.
  bool meet(TimePoint deadline);

  /// Waits until something comes back, or the deadline: the other side may find our reader later than
  /// we found its writer, and what it answers until then is lost.
  void settle(TimePoint deadline);

  /// Returns the time there and back of a sample of that many bytes; nothing if it did not come back by the deadline.
  std::optional<std::chrono::nanoseconds> call(std::size_t bytes, TimePoint deadline);

 private:
  std::string session_;
  int calls_ = 0;
  wire::Writer<jostle_msgs::msg::Goal> there_;
  wire::Inbox<jostle_msgs::msg::Goal> back_;
};

}  // namespace jostle::tools
