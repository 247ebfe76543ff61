#pragma once
/// \file
/// SampleQueue: from the middleware's threads to the one that writes.

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <span>
#include <stop_token>
#include <vector>

#include "services/bags/format/message.hpp"
#include "services/bags/listening/record_clock.hpp"

namespace jostle::bags {

struct QueuedSample {
  int topic = 0;
  Time log_time = 0, publish_time = 0;
  std::vector<std::byte> data;

  std::uint64_t memory() const { return sizeof *this + data.size(); }
};

/// A SampleQueue takes in samples without ever waiting for whoever takes them out. Samples without room
/// in memory are counted as lost.
///
/// Threads  push from any, take from one.
class SampleQueue {
 public:
  /// `capacity`: bytes, for what is in the queue and what the last take() gave out together. `clock` stamps the
  /// samples, and outlives the queue.
  SampleQueue(std::uint64_t capacity, const RecordClock& clock) : capacity_(capacity), clock_(clock) {}

  /// Copies the sample and stamps it. False if there was no room.
  bool push(int topic, std::span<const std::byte> data, Time publish_time);

  /// Takes everything there is, in the order of log times. Waits for a good deal of it until the
  /// deadline; returns at once after a stop request.
  std::vector<QueuedSample> take(std::chrono::steady_clock::time_point deadline, std::stop_token stop);

  /// Samples of a topic that had no room.
  std::uint64_t overflowed(int topic) const;

 private:
  const std::uint64_t capacity_;
  const RecordClock& clock_;
  mutable std::mutex mutex_;  // guards all below
  std::condition_variable_any filled_;
  std::vector<QueuedSample> samples_;
  std::uint64_t queued_ = 0, given_out_ = 0;  // bytes
  Time newest_ = 0;
  std::vector<std::uint64_t> overflowed_;  // by topic
};

}  // namespace jostle::bags
