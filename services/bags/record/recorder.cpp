#include "services/bags/record/recorder.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <utility>

#include "services/wire/dds/names.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::bags {
namespace {

constexpr std::chrono::milliseconds kTick{50};
constexpr std::chrono::milliseconds kFlush{400};        // and a tick: half a second at most
constexpr std::chrono::seconds kSettled{3};             // topics that are there have been found by then
constexpr std::chrono::milliseconds kAfterResult{300};  // the last words around a result
constexpr std::uint64_t kLookAtDisk = 16 << 20;         // bytes written before the next look at the disk

// Reliable, as `ros2 topic pub` is: a best-effort reader misses what comes before it has found
// the writer, even if the writer has found it.
const wire::RawTopic kTrigger{"rt/record/trigger", "std_msgs::msg::dds_::Empty_", {.depth = kKeepAll}};

// Free bytes of the disk that a file will be on; its folder may not be there yet.
Result<std::uint64_t> free_disk(std::filesystem::path place) {
  std::error_code ignored;
  place = std::filesystem::absolute(place, ignored);
  while (!std::filesystem::exists(place, ignored) && place.has_parent_path() && place != place.parent_path()) {
    place = place.parent_path();
  }
  struct statvfs disk {};
  if (statvfs(place.c_str(), &disk) != 0) {
    return Error{Code::kIo, fmt::format("{}: free disk space is unknown: {}", place.string(), std::strerror(errno))};
  }
  return static_cast<std::uint64_t>(disk.f_bavail) * disk.f_frsize;
}

double mebibytes(std::uint64_t bytes) { return static_cast<double>(bytes) / (1 << 20); }

}  // namespace

// A bag that is being written: topics join it with their first message.
class Recorder::OpenBag {
 public:
  OpenBag(std::unique_ptr<BagWriter> writer, const Subscriptions& subscriptions)
      : writer_(std::move(writer)), subscriptions_(subscriptions) {}

  Result<void> write(const QueuedSample& sample, Time log_time) {
    const auto place = static_cast<std::size_t>(sample.topic);
    if (places_.size() <= place) places_.resize(place + 1);
    Place& topic = places_[place];
    if (topic.index < 0) {
      auto index_result = writer_->add_topic(subscriptions_.topic(sample.topic));
      if (!index_result) return index_result.error();
      topic.index = *index_result;
    }
    const auto begin = Clock::now();
    auto written = writer_->write(
        topic.index,
        {.log_time = log_time, .publish_time = sample.publish_time, .sequence = ++topic.messages, .data = sample.data});
    worst_write_ = std::max(worst_write_, Clock::now() - begin);
    return written;
  }

  Clock::duration worst_write() const { return worst_write_; }

  BagWriter& writer() { return *writer_; }

 private:
  struct Place {
    int index = -1;
    std::uint32_t messages = 0;
  };

  std::unique_ptr<BagWriter> writer_;
  const Subscriptions& subscriptions_;
  std::vector<Place> places_;  // by topic
  Clock::duration worst_write_{0};
};

Result<std::unique_ptr<Recorder>> Recorder::start(RecordOptions options, Watcher watcher) {
  std::unique_ptr<Recorder> recorder(new Recorder(std::move(options), std::move(watcher)));
  if (auto ok = recorder->check_disk(); !ok) return ok.error();
  const RecordOptions& own = recorder->options_;
  auto subscriptions_result = Subscriptions::open(
      {.domain = own.domain,
       .selection = own.selection,
       .definition = [self =
                          recorder.get()](const std::string& type) { return self->options_.messages.definition(type); },
       .on_sample = [self = recorder.get()](int topic, std::span<const std::byte> data,
                                            const wire::Origin& origin) { self->on_sample(topic, data, origin); },
       .on_warning = recorder->watcher_.on_warning});
  if (!subscriptions_result) return subscriptions_result.error();
  recorder->subscriptions_ = std::move(subscriptions_result).value();
  if (own.until_result && !recorder->hears_results()) {
    return Error{Code::kInvalidArgument, fmt::format("--until-result: got a selection without {}, wanted one with it",
                                                     recorder->result_topic())};
  }
  // Samples wait in the queue meanwhile; and what failed so far has left no folder.
  auto ready = own.ring.count() > 0 ? recorder->await_triggers() : recorder->open_bag();
  if (!ready) return ready.error();
  return recorder;
}

Result<void> Recorder::open_bag() {
  auto writer_result = BagWriter::create(options_.folder, options_.bag);
  if (!writer_result) return writer_result.error();
  bag_ = std::make_unique<OpenBag>(std::move(writer_result).value(), *subscriptions_);
  bag_->writer().set_note("record", options_.note);
  bag_->writer().set_note("lost", lost_note());
  bags_.push_back(options_.folder);
  return {};
}

Result<void> Recorder::await_triggers() {
  try {
    trigger_reader_ =
        std::make_unique<wire::RawReader>(subscriptions_->participant(), kTrigger,
                                          [this](std::span<const std::byte>, const wire::Origin&) { trigger(); });
    return {};
  } catch (const wire::SetupError& error) {
    return Error{Code::kUnavailable, error.what()};
  }
}

Recorder::Recorder(RecordOptions options, Watcher watcher)
    : options_(std::move(options)),
      watcher_(std::move(watcher)),
      started_at_(clock_.at(started_)),
      // A ring needs most of the memory for itself.
      queue_(options_.ring.count() > 0 ? options_.max_memory / 4 : options_.max_memory, clock_) {}

Recorder::~Recorder() {
  trigger_reader_.reset();
  if (subscriptions_) subscriptions_->close();  // its threads call on_sample()
}

// In our namespace: another robot's task is not the one that is waited for.
std::string Recorder::result_topic() const {
  return *wire::ros_topic(
      subscriptions_->participant().wire_name(wire::topics::kTaskResult.name, wire::topics::kTaskResult.scope));
}

bool Recorder::hears_results() const {
  for (int topic = 0; topic < topics(); ++topic) {
    if (subscriptions_->topic(topic).name == result_topic()) return true;
  }
  return false;
}

// On the middleware's threads.
void Recorder::on_sample(int topic, std::span<const std::byte> data, const wire::Origin& origin) {
  queue_.push(topic, data, origin.source_time);
}

// The next free one: whoever starts a ring again keeps what was written before.
std::filesystem::path Recorder::next_snapshot() const {
  std::error_code ignored;
  for (int number = 1;; ++number) {
    std::filesystem::path folder = options_.folder;
    folder += fmt::format("-{}", number);
    if (!std::filesystem::exists(folder, ignored)) return folder;
  }
}

RecordReport Recorder::run(std::stop_token stop) {
  Clock::time_point flushed = Clock::now();
  std::optional<Clock::time_point> end;
  if (options_.duration.count() > 0) end = started_ + options_.duration;
  std::string reason = "stopped";
  bool has_settled = false;
  for (;;) {
    look_at_clock();
    if (auto ok = take_in_all(queue_.take(Clock::now() + kTick, stop)); !ok) return finish("failed", ok.error());
    write_snapshots();
    const auto now = Clock::now();
    if (result_seen_ && (!end || *end > now + kAfterResult)) {
      end = now + kAfterResult;
      reason = "the task has a result";
      result_seen_ = false;
    }
    if (now - started_ >= kSettled && !std::exchange(has_settled, true)) warn_of_unmatched_globs();
    if (now - flushed >= kFlush) {
      flushed = now;
      if (bag_) {
        bag_->writer().set_note("lost", lost_note());
        if (auto ok = bag_->writer().flush(); !ok) return finish("failed", ok.error());
        for (Tally& tally : tallies_) tally.safe = tally.written;
      }
      if (bag_) look_at_disk();
      if (watcher_.on_progress) watcher_.on_progress(status());
    }
    if (disk_problem_) return finish("the disk is nearly full", {});
    if (stop.stop_requested()) return finish("stopped", {});
    if (end && now >= *end) return finish(reason == "stopped" ? "its time is over" : reason, {});
  }
}

Recorder::Tally& Recorder::tally_of(int topic) {
  const auto place = static_cast<std::size_t>(topic);
  if (tallies_.size() <= place) tallies_.resize(place + 1);
  Tally& tally = tallies_[place];
  if (!std::exchange(tally.known, true)) {
    const Topic known = subscriptions_->topic(topic);
    tally.latched = known.qos.latched;
    tally.is_result = known.name == result_topic();
  }
  return tally;
}

Result<void> Recorder::take_in(QueuedSample sample) {
  Tally& tally = tally_of(sample.topic);
  const std::uint64_t memory = sample.memory();
  // Results of earlier tasks are kept by who wrote them.
  if (options_.until_result && tally.is_result && sample.publish_time >= started_at_ + clock_.set_by().count())
    result_seen_ = true;
  if (bag_) {
    if (auto ok = bag_->write(sample, sample.log_time); !ok) {
      ++tally.unwritten;
      return ok;
    }
    unchecked_ += memory;
    if (unchecked_ >= kLookAtDisk) look_at_disk();
  } else {
    keep(std::move(sample));
  }
  ++tally.written;
  ++messages_;
  return {};
}

// After the first failure the rest is counted as lost.
Result<void> Recorder::take_in_all(std::vector<QueuedSample> samples) {
  Result<void> result;
  for (QueuedSample& sample : samples) {
    if (result) {
      result = take_in(std::move(sample));
    } else {
      ++tally_of(sample.topic).unwritten;
    }
  }
  return result;
}

void Recorder::keep(QueuedSample sample) {
  forget_old(sample.log_time);
  ring_bytes_ += sample.memory();
  ring_.push_back(std::move(sample));
}

void Recorder::forget_old(Time now) {
  const std::uint64_t room = options_.max_memory - options_.max_memory / 4;
  while (!ring_.empty()) {
    const bool old = now - ring_.front().log_time > options_.ring.count();
    const bool much = ring_bytes_ > room;
    if (!old && !much) return;
    if (!old && !std::exchange(ring_short_, true)) {
      warn(fmt::format("the ring holds {:.1f} s, wanted {:.1f}: more does not fit into --max-memory",
                       1e-9 * static_cast<double>(now - ring_.front().log_time),
                       1e-9 * static_cast<double>(options_.ring.count())));
    }
    QueuedSample sample = std::move(ring_.front());
    ring_.pop_front();
    ring_bytes_ -= sample.memory();
    if (tally_of(sample.topic).latched) in_force_.insert_or_assign(sample.topic, std::move(sample));
  }
}

void Recorder::write_snapshots() {
  if (triggers_.exchange(0) == 0) return;  // those that came together want the same
  if (bag_) return warn("a trigger without --ring does nothing: everything is recorded anyway");
  // What came before the trigger may still wait.
  if (auto ok = take_in_all(queue_.take(Clock::now(), {})); !ok) return warn(ok.error().message);
  forget_old(clock_.at(Clock::now()));
  if (ring_.empty() && in_force_.empty()) return warn("the ring is empty: nothing was written");
  auto written = check_disk();
  if (written) written = write_snapshot();
  if (!written) {
    warn(written.error().message);
    snapshot_problem_ = written.error();
  }
}

Result<void> Recorder::write_snapshot() {
  const std::filesystem::path folder = next_snapshot();
  auto writer_result = BagWriter::create(folder, options_.bag);
  if (!writer_result) return writer_result.error();
  bags_.push_back(folder);
  OpenBag snapshot(std::move(writer_result).value(), *subscriptions_);
  const Time begin = ring_.empty() ? clock_.at(Clock::now()) : ring_.front().log_time;
  Result<void> result;
  // What latched topics last said before the ring begins is what holds when it begins.
  for (const auto& [topic, sample] : in_force_) {
    if (result) result = snapshot.write(sample, begin);
  }
  for (const QueuedSample& sample : ring_) {
    if (result) result = snapshot.write(sample, sample.log_time);
  }
  snapshot.writer().set_note("record", options_.note);
  snapshot.writer().set_note("lost", lost_note());
  if (!clock_note_.empty()) snapshot.writer().set_note("clock", clock_note_);
  auto closed = snapshot.writer().close();
  snapshot_bytes_ += snapshot.writer().bytes();
  if (result) result = closed;
  if (result && watcher_.on_snapshot) watcher_.on_snapshot(folder);
  return result;
}

void Recorder::look_at_clock() {
  const std::chrono::duration<double> step = clock_.look();
  if (step.count() == 0.0) return;
  const std::chrono::duration<double> elapsed = Clock::now() - started_;
  warn(
      fmt::format("the wall clock was set {} by {:.3f} s; log times go on evenly, those at which others say they sent "
                  "may not",
                  step.count() < 0 ? "back" : "forward", std::abs(step.count())));
  constexpr std::size_t kMostSteps = 100;
  if (clock_note_.size() >= kMostSteps) return;
  clock_note_[fmt::format("after {:.1f} s", elapsed.count())] = fmt::format("set by {:+.3f} s", step.count());
  if (bag_) bag_->writer().set_note("clock", clock_note_);
}

void Recorder::warn_of_unmatched_globs() const {
  const std::vector<std::string> others = subscriptions_->passed_over();
  for (const std::string& glob : options_.selection.topics) {
    bool found = false;
    for (int topic = 0; topic < topics() && !found; ++topic)
      found = Selection{.topics = {glob}}.wants(subscriptions_->topic(topic).name);
    if (found) continue;
    warn(
        fmt::format("{}: no topic of that name that can be recorded was found so far; {}", glob,
                    others.empty() ? "others were not, either" : fmt::format("there are {}", fmt::join(others, ", "))));
  }
}

void Recorder::warn(const std::string& text) const {
  if (watcher_.on_warning) watcher_.on_warning(text);
}

Result<void> Recorder::check_disk() const {
  auto free_result = free_disk(options_.folder);
  if (!free_result) return free_result.error();
  if (*free_result >= options_.min_free) return {};
  return Error{
      Code::kIo,
      fmt::format(
          "{}: got {:.0f} MiB of free disk, wanted at least {:.0f}; make room, or let `jostle record --min-free` do "
          "with less",
          options_.folder.string(), mebibytes(*free_result), mebibytes(options_.min_free))};
}

std::uint64_t Recorder::lost(int topic) const {
  const auto place = static_cast<std::size_t>(topic);
  const std::uint64_t unwritten = place < tallies_.size() ? tallies_[place].unwritten : 0;
  return subscriptions_->missing(topic) + queue_.overflowed(topic) + unwritten;
}

Note Recorder::lost_note() const {
  Note note;
  for (int topic = 0; topic < topics(); ++topic) note[subscriptions_->topic(topic).name] = std::to_string(lost(topic));
  return note;
}

RecordStatus Recorder::status() const {
  RecordStatus status{.seconds = std::chrono::duration<double>(Clock::now() - started_).count()};
  status.messages = bag_ ? messages_ : ring_.size();
  if (bag_) status.worst_write = std::chrono::duration<double>(bag_->worst_write()).count();
  status.bytes = bag_ ? bag_->writer().bytes() : ring_bytes_;
  for (int topic = 0; topic < topics(); ++topic) status.lost += lost(topic);
  status.topics =
      static_cast<int>(std::ranges::count_if(tallies_, [](const Tally& tally) { return tally.written > 0; }));
  if (auto free_result = free_disk(options_.folder)) status.free_disk = *free_result;
  return status;
}

// After a failed write: what was written since the last flush may or may not be on the disk.
void Recorder::count_unsafe() {
  for (Tally& tally : tallies_) {
    const std::uint64_t unsafe = tally.written - tally.safe;
    tally.written -= unsafe;
    tally.unwritten += unsafe;
    messages_ -= unsafe;
  }
}

void Recorder::look_at_disk() {
  unchecked_ = 0;
  if (auto ok = check_disk(); !ok) disk_problem_ = ok.error();
}

RecordReport Recorder::finish(std::string reason, std::optional<Error> failure) {
  trigger_reader_.reset();
  for (const auto& [topic, refusals] : subscriptions_->unmatched()) {
    warn(fmt::format(
        "{}: it has a writer and none of its messages came; got {} refusals by the middleware, wanted an offer "
        "that a plain reader takes (shared ownership, no partition)",
        topic, refusals));
  }
  subscriptions_->close();
  warn_of_unmatched_globs();
  // What came before the end belongs to it; after a failed write it is counted as lost.
  auto rest = queue_.take(Clock::now(), {});
  if (failure) {
    for (const QueuedSample& sample : rest) ++tally_of(sample.topic).unwritten;
  } else if (auto ok = take_in_all(std::move(rest)); !ok) {
    failure = ok.error();
  }
  write_snapshots();
  RecordReport report{.reason = std::move(reason)};
  if (bag_) {
    if (failure) count_unsafe();
    bag_->writer().set_note("lost", lost_note());
    if (auto ok = bag_->writer().close(); !ok && !failure) failure = ok.error();
  }
  report.bags = bags_;
  report.status = status();
  if (!bag_) report.status.bytes = snapshot_bytes_;
  for (int topic = 0; topic < topics(); ++topic) {
    const auto place = static_cast<std::size_t>(topic);
    report.topics[subscriptions_->topic(topic).name] = {
        .messages = place < tallies_.size() ? tallies_[place].written : 0, .lost = lost(topic)};
  }
  report.problem = failure ? failure : disk_problem_ ? disk_problem_ : snapshot_problem_;
  return report;
}

}  // namespace jostle::bags
