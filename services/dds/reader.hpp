#pragma once
/// \file
/// Reader: follows one topic, by callback or through a queue.

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <vector>

#include "services/dds/participant.hpp"
#include "services/dds/topic.hpp"
#include "services/dds/writer.hpp"

namespace jostle::dds {

/// Everything about a reader that does not depend on its type.
class ReaderBase {
 public:
  /// `on_sample` gets a sample of the topic's type. Throws SetupError.
  ReaderBase(const Participant& participant, const std::string& topic, const Qos& qos,
             eprosima::fastdds::dds::TypeSupport type,
             std::function<void(const void* sample)> on_sample);
  /// Waits for a running callback; none runs afterwards.
  ~ReaderBase();
  ReaderBase(const ReaderBase&) = delete;
  ReaderBase& operator=(const ReaderBase&) = delete;

  /// Writers found so far, and gone ones not counted.
  int matched() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// Calls back for every sample, in the order of each writer.
///
/// Threads  the callback runs on the middleware's thread, one call at a time.
///          It must be quick, must not throw, and must not make or destroy
///          writers or readers.
template <class T>
class Reader : public ReaderBase {
 public:
  using OnSample = std::function<void(const T&)>;

  Reader(const Participant& participant, const Topic<T>& topic, OnSample on_sample)
      : ReaderBase(participant, participant.wire_name(topic.name, topic.scope), topic.qos,
                   eprosima::fastdds::dds::TypeSupport(new Serializer<T>()),
                   [on_sample = std::move(on_sample)](const void* sample) {
                     on_sample(*static_cast<const T*>(sample));
                   }) {}
};

/// Keeps samples until somebody takes them. When full the oldest one goes and
/// is counted; capacity 1 keeps the newest.
///
/// Threads  safe from any thread.
template <class T>
class Inbox {
 public:
  Inbox(const Participant& participant, const Topic<T>& topic, std::size_t capacity)
      : capacity_(capacity),
        reader_(participant, topic, [this](const T& sample) { put(sample); }) {}

  /// The oldest sample; waits for one until the deadline or a stop request.
  std::optional<T> take(TimePoint deadline, std::stop_token stop = {}) {
    std::unique_lock lock(mutex_);
    if (!arrived_.wait_until(lock, stop, deadline, [&] { return !samples_.empty(); })) return {};
    T sample = std::move(samples_.front());
    samples_.pop_front();
    return sample;
  }

  /// Everything that is there, oldest first, without waiting.
  std::deque<T> take_all() {
    const std::lock_guard lock(mutex_);
    return std::exchange(samples_, {});
  }

  std::uint64_t dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }

  int matched() const { return reader_.matched(); }

 private:
  void put(const T& sample) {
    {
      const std::lock_guard lock(mutex_);
      if (samples_.size() == capacity_) {
        samples_.pop_front();
        ++dropped_;
      }
      samples_.push_back(sample);
    }
    arrived_.notify_one();
  }

  const std::size_t capacity_;
  mutable std::mutex mutex_;  // guards samples_ and dropped_
  std::condition_variable_any arrived_;
  std::deque<T> samples_;
  std::uint64_t dropped_ = 0;
  Reader<T> reader_;  // last: stops before what it fills is gone
};

}  // namespace jostle::dds
