#pragma once
/// \file
/// Reader: follows one topic, by callback or through a queue.

#include <algorithm>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <utility>
#include <vector>

#include "services/wire/dds/guid.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/topic.hpp"
#include "services/wire/dds/writer.hpp"
#include "services/wire/limits.hpp"

namespace jostle::wire {

/// Where a sample comes from.
struct Origin {
  std::uint64_t participant = 0;  ///< Participant::id() of who wrote it
  Guid writer{};
  std::uint64_t sequence = 0;    ///< the writer's, counting from 1: a gap is a lost sample
  std::int64_t source_time = 0;  ///< when it was written, ns since the Unix epoch, on the writer's clock
};

/// Counts of what has not reached a reader, so far.
struct ReaderTroubles {
  std::uint64_t lost = 0;          ///< samples that the middleware gave up
  std::uint64_t rejected = 0;      ///< samples without room when they came; a reliable writer sends them again
  std::uint64_t incompatible = 0;  ///< writers that offer less than is asked for
};

/// Everything about a reader that does not depend on its type.
class ReaderBase {
 public:
  /// `on_sample` gets a sample of the topic's type. Throws SetupError.
  ReaderBase(const Participant& participant, const std::string& topic, const Qos& qos,
             eprosima::fastdds::dds::TypeSupport type,
             std::function<void(void* sample, const Origin& origin)> on_sample);
  /// Waits for a running callback; none runs afterwards.
  ~ReaderBase();
  ReaderBase(const ReaderBase&) = delete;
  ReaderBase& operator=(const ReaderBase&) = delete;

  /// Returns the number of writers that were found and have not gone.
  int matched() const;

  /// Returns Participant::id() of every participant that has a writer for us; each once, ascending.
  std::vector<std::uint64_t> matched_participants() const;

  /// Whether that participant has a writer for us; the counterpart of WriterBase::reaches().
  bool hears(std::uint64_t participant) const;

  ReaderTroubles troubles() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// A Reader calls back for every sample; those of one writer in its order. The sample is the callback's to keep: it may
/// take a reference to const, or one to what it moves from.
///
/// Threads  the callback runs on the middleware's thread, one call at a time.
///          It must be quick, must not throw, and must not make or destroy
///          writers or readers.
template <class T>
class Reader : public ReaderBase {
 public:
  using OnSample = std::function<void(const T&)>;
  using OnSampleOf = std::function<void(T&, const Origin&)>;

  Reader(const Participant& participant, const Topic<T>& topic, OnSample on_sample)
      : Reader(participant, topic,
               OnSampleOf([on_sample = std::move(on_sample)](T& sample, const Origin&) { on_sample(sample); })) {}

  Reader(const Participant& participant, const Topic<T>& topic, OnSampleOf on_sample)
      : ReaderBase(participant, participant.wire_name(topic.name, topic.scope), topic.qos,
                   eprosima::fastdds::dds::TypeSupport(new Serializer<T>()),
                   [on_sample = std::move(on_sample)](void* sample, const Origin& origin) {
                     on_sample(*static_cast<T*>(sample), origin);
                   }) {}
};

/// An Inbox keeps samples until somebody takes them. When a participant has `capacity` of them here its oldest one goes
/// and is counted, nobody else's; capacity 1 keeps the newest. Beyond limits::kSendersPerInbox times as many of all
/// participants the oldest goes, whosever it is.
///
/// Threads  safe from any thread.
template <class T>
class Inbox {
 public:
  /// A sample, and Participant::id() of who wrote it.
  struct Letter {
    T sample;
    std::uint64_t writer = 0;
  };

  Inbox(const Participant& participant, const Topic<T>& topic, std::size_t capacity)
      : capacity_(capacity),
        reader_(participant, topic, typename Reader<T>::OnSampleOf([this](T& sample, const Origin& origin) {
                  put({std::move(sample), origin.participant});
                })) {}

  /// Takes the oldest sample; waits for one until the deadline or a stop request.
  std::optional<T> take(TimePoint deadline, std::stop_token stop = {}) {
    auto letter = take_letter(deadline, std::move(stop));
    if (!letter) return {};
    return std::move(letter->sample);
  }

  /// Takes it with who wrote it.
  std::optional<Letter> take_letter(TimePoint deadline, std::stop_token stop = {}) {
    std::unique_lock lock(mutex_);
    if (!arrived_.wait_until(lock, stop, deadline, [&] { return !letters_.empty(); })) return {};
    Letter letter = std::move(letters_.front());
    letters_.pop_front();
    return letter;
  }

  /// Returns Participant::id() of who wrote the newest sample that arrived, taken or not; nothing
  /// before the first.
  std::optional<std::uint64_t> last_writer() const {
    const std::lock_guard lock(mutex_);
    return last_writer_;
  }

  /// Takes everything that is there, oldest first, without waiting.
  std::deque<T> take_all() {
    std::deque<T> samples;
    for (Letter& letter : take_letters()) samples.push_back(std::move(letter.sample));
    return samples;
  }

  std::deque<Letter> take_letters() {
    const std::lock_guard lock(mutex_);
    return std::exchange(letters_, {});
  }

  std::uint64_t dropped() const {
    const std::lock_guard lock(mutex_);
    return dropped_;
  }

  int matched() const { return reader_.matched(); }
  std::vector<std::uint64_t> matched_participants() const { return reader_.matched_participants(); }
  bool hears(std::uint64_t participant) const { return reader_.hears(participant); }

 private:
  void put(Letter letter) {
    {
      const std::lock_guard lock(mutex_);
      const auto is_of_same = [&](const Letter& other) { return other.writer == letter.writer; };
      if (static_cast<std::size_t>(std::ranges::count_if(letters_, is_of_same)) >= capacity_) {
        letters_.erase(std::ranges::find_if(letters_, is_of_same));
        ++dropped_;
      } else if (letters_.size() >= limits::kSendersPerInbox * capacity_) {
        letters_.pop_front();
        ++dropped_;
      }
      last_writer_ = letter.writer;
      letters_.push_back(std::move(letter));
    }
    arrived_.notify_one();
  }

  const std::size_t capacity_;
  mutable std::mutex mutex_;  // guards letters_, dropped_ and last_writer_
  std::condition_variable_any arrived_;
  std::deque<Letter> letters_;
  std::uint64_t dropped_ = 0;
  std::optional<std::uint64_t> last_writer_;
  Reader<T> reader_;  // last: stops before what it fills is gone
};

}  // namespace jostle::wire
