#pragma once
/// \file
/// Recorder: writes what is said in a domain into a bag.

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "services/bags/format/bag_writer.hpp"
#include "services/bags/format/message_files.hpp"
#include "services/bags/listening/record_clock.hpp"
#include "services/bags/listening/subscriptions.hpp"
#include "services/bags/record/sample_queue.hpp"
#include "services/wire/dds/raw.hpp"

namespace jostle::bags {

struct RecordOptions {
  std::filesystem::path folder;  ///< the bag's; with a ring, bags are FOLDER-1, FOLDER-2, … as far as they are free
  Selection selection;
  BagOptions bag;
  std::chrono::nanoseconds ring{0};      ///< keep so much, and write it when asked to; 0: write everything
  std::uint64_t max_memory = 256 << 20;  ///< bytes of samples in memory, > 0
  std::uint64_t min_free = 512 << 20;    ///< bytes on the disk; below, the recording ends, or the ring is not written
  std::chrono::nanoseconds duration{0};  ///< the recording ends after it; 0: never by itself
  bool until_result = false;             ///< it ends shortly after a task's result
  std::optional<int> domain;
  MessageFiles messages{};  ///< definitions beside the bag format's own
  Note note;                ///< stored as "record"
};

struct TopicCount {
  std::uint64_t messages = 0;  ///< written
  /// Messages that did not come (gaps in a writer's numbers), had no room in memory, or could not be written.
  std::uint64_t lost = 0;
};

struct RecordStatus {
  double seconds = 0.0;        ///< since the start
  std::uint64_t messages = 0;  ///< written, or in the ring
  std::uint64_t bytes = 0;     ///< size of the files, or of the ring
  std::uint64_t lost = 0;
  std::uint64_t free_disk = 0;  ///< bytes
  int topics = 0;               ///< with messages
  double worst_write = 0.0;     ///< s, longest single write to the bag; without a ring
};

struct RecordReport {
  std::vector<std::filesystem::path> bags;
  RecordStatus status;
  std::map<std::string, TopicCount> topics;
  std::string reason;            ///< why it ended
  std::optional<Error> problem;  ///< why it ended before its time
};

/// Copies samples on the middleware's threads into a queue in memory, and writes them on one
/// of its own: neither waits for the other, and nobody who publishes waits for either. At least
/// every half second all of it is handed to the operating system, which a killed recorder
/// cannot take back.
///
/// Notes in the bag   "record"  RecordOptions::note
///                    "lost"    every topic's TopicCount::lost as it is known when a file is closed
///                    "clock"   when the wall clock was set, and by how much; only if it was
/// Log times          go on evenly when the wall clock is set (RecordClock)
/// Ring               the newest sample of a latched topic stays when its time is over, and stands
///                    at the beginning of what is written
class Recorder {
 public:
  struct Watcher {
    std::function<void(const std::string&)> on_warning;             ///< from any thread
    std::function<void(const RecordStatus&)> on_progress;           ///< twice a second
    std::function<void(const std::filesystem::path&)> on_snapshot;  ///< a bag of the ring is complete
  };

  /// Starts a recorder, which is subscribed when this returns.
  /// Errors   kInvalidArgument  the folder exists, a selection without results for until_result, a domain
  ///                            that is none
  ///          kIo               less free disk than min_free, or the folder cannot be made
  ///          kUnavailable
  static Result<std::unique_ptr<Recorder>> start(RecordOptions options, Watcher watcher);
  ~Recorder();

  /// Writes until a stop is requested, or something else ends it. May be called once.
  RecordReport run(std::stop_token stop);

  /// Writes the ring, soon. From any thread, from signal handlers too.
  void trigger() { triggers_.fetch_add(1); }

  int topics() const { return subscriptions_->topics(); }  ///< subscribed
  int domain() const { return subscriptions_->participant().domain(); }

 private:
  using Clock = std::chrono::steady_clock;
  class OpenBag;

  // Counts a topic's samples, and knows what does not change once there is one.
  struct Tally {
    std::uint64_t written = 0, unwritten = 0;
    std::uint64_t safe = 0;  // those written that the operating system has
    bool known = false;
    bool latched = false, is_result = false;
  };

  Recorder(RecordOptions options, Watcher watcher);

  void on_sample(int topic, std::span<const std::byte> data, const wire::Origin& origin);
  std::string result_topic() const;
  bool hears_results() const;
  Result<void> open_bag();
  Result<void> await_triggers();
  std::filesystem::path next_snapshot() const;
  Result<void> take_in(QueuedSample sample);
  Result<void> take_in_all(std::vector<QueuedSample> samples);
  Tally& tally_of(int topic);
  void keep(QueuedSample sample);
  void write_snapshots();
  Result<void> write_snapshot();
  void warn(const std::string& text) const;
  Result<void> check_disk() const;
  void look_at_disk();
  void forget_old(Time now);
  void look_at_clock();
  void warn_of_unmatched_globs() const;
  Note lost_note() const;
  std::uint64_t lost(int topic) const;
  RecordStatus status() const;
  void count_unsafe();
  RecordReport finish(std::string reason, std::optional<Error> failure);

  const RecordOptions options_;
  const Watcher watcher_;
  const Clock::time_point started_ = Clock::now();
  RecordClock clock_;
  const Time started_at_;  // by the wall clock
  Note clock_note_;        // when the wall clock was set, and by how much
  SampleQueue queue_;
  std::atomic<int> triggers_ = 0;
  bool result_seen_ = false;

  std::deque<QueuedSample> ring_;
  std::uint64_t ring_bytes_ = 0;
  bool ring_short_ = false;
  std::map<int, QueuedSample> in_force_;  // by topic: newest of a latched one that left the ring

  std::deque<Tally> tallies_;  // by topic
  std::uint64_t messages_ = 0;
  std::uint64_t unchecked_ = 0;        // bytes since the disk was looked at
  std::optional<Error> disk_problem_;  // less free than min_free
  std::optional<Error> snapshot_problem_;
  std::uint64_t snapshot_bytes_ = 0;
  std::vector<std::filesystem::path> bags_;

  std::unique_ptr<Subscriptions> subscriptions_;
  std::unique_ptr<OpenBag> bag_;                     // none with a ring
  std::unique_ptr<wire::RawReader> trigger_reader_;  // before the subscriptions' participant goes
};

}  // namespace jostle::bags
