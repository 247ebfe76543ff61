#include "services/record/recorder.hpp"

#include <fmt/format.h>
#include <sys/statvfs.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include "services/dds/names.hpp"
#include "services/dds/system_topics.hpp"
#include "services/dds/topics.hpp"

namespace jostle::services {
namespace {

constexpr std::chrono::milliseconds kTick{50};
constexpr std::chrono::milliseconds kFlush{400};     // and a tick: half a second at most
constexpr std::chrono::milliseconds kAfterResult{300};  // the last words around a result
constexpr std::uint64_t kLookAtDisk = 16 << 20;      // bytes written before the next look at the disk

const dds::RawTopic kTrigger{"rt/record/trigger", "std_msgs::msg::dds_::Empty_", {.reliable = false, .depth = dds::kKeepAll}};

bag::Time wall_clock() {
  const std::chrono::nanoseconds now = std::chrono::system_clock::now().time_since_epoch();
  return now.count();
}

// Of the disk that a file will be on; its folder may not be there yet.
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

// TODO(#6): the text of the definition, which the room of bags will know.
std::optional<std::string> definition_of(const std::string& type) {
  const auto& topics = dds::system_topics();
  const bool known = std::ranges::any_of(topics, [&](const auto& topic) { return dds::ros_type(topic.type) == type; });
  return known ? std::optional<std::string>("") : std::nullopt;
}

double mebibytes(std::uint64_t bytes) { return static_cast<double>(bytes) / (1 << 20); }

}  // namespace

// A bag that is being written: topics join it with their first message.
class Recorder::OpenBag {
 public:
  OpenBag(std::unique_ptr<bag::BagWriter> writer, const Subscriptions& subscriptions)
      : writer_(std::move(writer)), subscriptions_(subscriptions) {}

  Result<void> write(const QueuedSample& sample, bag::Time log_time) {
    const auto place = static_cast<std::size_t>(sample.topic);
    if (places_.size() <= place) places_.resize(place + 1);
    Place& topic = places_[place];
    if (topic.index < 0) {
      auto index_result = writer_->add_topic(subscriptions_.topic(sample.topic));
      if (!index_result) return index_result.error();
      topic.index = *index_result;
    }
    return writer_->write(topic.index, {.log_time = log_time, .publish_time = sample.publish_time, .sequence = ++topic.messages,
                                        .data = sample.data});
  }

  bag::BagWriter& writer() { return *writer_; }

 private:
  struct Place {
    int index = -1;
    std::uint32_t messages = 0;
  };

  std::unique_ptr<bag::BagWriter> writer_;
  const Subscriptions& subscriptions_;
  std::vector<Place> places_;  // by topic
};

Result<std::unique_ptr<Recorder>> Recorder::start(RecordOptions options, Watcher watcher) {
  if (options.until_result && !options.selection.wants(*dds::ros_topic(topics::kTaskResult.name))) {
    return Error{Code::kInvalidArgument, fmt::format("--until-result: got a selection without {}, wanted one with it",
                                                     *dds::ros_topic(topics::kTaskResult.name))};
  }
  std::unique_ptr<Recorder> recorder(new Recorder(std::move(options), std::move(watcher)));
  if (auto ok = recorder->check_disk(); !ok) return Error{Code::kInvalidArgument, ok.error().message};
  const RecordOptions& own = recorder->options_;
  const std::filesystem::path folder = recorder->next_folder();
  std::unique_ptr<bag::BagWriter> writer;
  if (own.ring.count() == 0) {
    auto writer_result = bag::BagWriter::create(folder, own.bag);
    if (!writer_result) return writer_result.error();
    writer = std::move(writer_result).value();
    recorder->bags_.push_back(folder);
  }
  auto subscriptions_result = Subscriptions::open(
      {.domain = own.domain,
       .selection = own.selection,
       .definition = [](const std::string& type) { return definition_of(type); },
       .on_sample = [self = recorder.get()](int topic, std::span<const std::byte> data,
                                            const dds::Origin& origin) { self->on_sample(topic, data, origin); },
       .on_warning = recorder->watcher_.on_warning});
  if (!subscriptions_result) return subscriptions_result.error();
  recorder->subscriptions_ = std::move(subscriptions_result).value();
  if (writer) {
    writer->set_note("record", own.note);
    writer->set_note("lost", recorder->lost_note());
  }
  if (writer) recorder->bag_ = std::make_unique<OpenBag>(std::move(writer), *recorder->subscriptions_);
  try {
    if (own.ring.count() > 0) {
      recorder->trigger_reader_ = std::make_unique<dds::RawReader>(
          recorder->subscriptions_->participant(), kTrigger,
          [self = recorder.get()](std::span<const std::byte>, const dds::Origin&) { self->trigger(); });
    }
  } catch (const dds::SetupError& error) {
    return Error{Code::kUnavailable, error.what()};
  }
  return recorder;
}

Recorder::Recorder(RecordOptions options, Watcher watcher)
    : options_(std::move(options)),
      watcher_(std::move(watcher)),
      started_at_(wall_clock()),
      // A ring needs most of the memory for itself.
      queue_(options_.ring.count() > 0 ? options_.max_memory / 4 : options_.max_memory) {}

Recorder::~Recorder() {
  trigger_reader_.reset();
  if (subscriptions_) subscriptions_->close();  // its threads call on_sample()
}

// On the middleware's threads.
void Recorder::on_sample(int topic, std::span<const std::byte> data, const dds::Origin& origin) {
  queue_.push(topic, data, origin.source_time);
}

std::filesystem::path Recorder::next_folder() const {
  if (options_.ring.count() == 0) return options_.folder;
  std::filesystem::path folder = options_.folder;
  folder += fmt::format("-{}", snapshots_ + 1);
  return folder;
}

RecordReport Recorder::run(std::stop_token stop) {
  Clock::time_point flushed = Clock::now();
  std::optional<Clock::time_point> end;
  if (options_.duration.count() > 0) end = started_ + options_.duration;
  std::string reason = "stopped";
  for (;;) {
    if (auto ok = take_in(queue_.take(Clock::now() + kTick, stop)); !ok) return finish("failed", ok.error());
    if (auto ok = write_snapshots(); !ok) return finish("failed", ok.error());
    const auto now = Clock::now();
    if (result_seen_ && (!end || *end > now + kAfterResult)) {
      end = now + kAfterResult;
      reason = "the task has a result";
      result_seen_ = false;
    }
    if (now - flushed >= kFlush) {
      flushed = now;
      if (bag_) {
        bag_->writer().set_note("lost", lost_note());
        if (auto ok = bag_->writer().flush(); !ok) return finish("failed", ok.error());
        safe_ = written_;
      }
      if (auto ok = check_disk(); !ok) return finish("the disk is nearly full", ok.error());
      if (watcher_.on_progress) watcher_.on_progress(status());
    }
    if (stop.stop_requested()) return finish("stopped", {});
    if (end && now >= *end) return finish(reason == "stopped" ? "its time is over" : reason, {});
  }
}

Result<void> Recorder::take_in(std::vector<QueuedSample> samples) {
  Result<void> result;
  for (QueuedSample& sample : samples) {
    const auto place = static_cast<std::size_t>(sample.topic);
    if (written_.size() <= place) written_.resize(place + 1), unwritten_.resize(place + 1);
    if (options_.until_result && sample.publish_time >= started_at_ && is_result(sample.topic)) result_seen_ = true;
    if (!result) {
      ++unwritten_[place];
      continue;
    }
    const std::uint64_t memory = sample.memory();
    if (bag_) {
      result = bag_->write(sample, sample.log_time);
    } else {
      keep(std::move(sample));
    }
    if (!result) {
      ++unwritten_[place];
      continue;
    }
    ++written_[place];
    ++messages_;
    unchecked_ += memory;
    if (unchecked_ >= kLookAtDisk) result = check_disk();
  }
  return result;
}

bool Recorder::is_result(int topic) {
  if (result_topic_ < 0 && subscriptions_->topic(topic).name == *dds::ros_topic(topics::kTaskResult.name)) result_topic_ = topic;
  return topic == result_topic_;
}

void Recorder::keep(QueuedSample sample) {
  forget_old(sample.log_time);
  ring_bytes_ += sample.memory();
  ring_.push_back(std::move(sample));
}

void Recorder::forget_old(bag::Time now) {
  const std::uint64_t room = options_.max_memory - options_.max_memory / 4;
  while (!ring_.empty()) {
    const bool old = now - ring_.front().log_time > options_.ring.count();
    const bool much = ring_bytes_ > room;
    if (!old && !much) return;
    if (!old && !std::exchange(ring_short_, true) && watcher_.on_warning) {
      watcher_.on_warning(fmt::format("the ring holds {:.1f} s, wanted {:.1f}: more does not fit into --max-memory",
                                      1e-9 * static_cast<double>(now - ring_.front().log_time),
                                      1e-9 * static_cast<double>(options_.ring.count())));
    }
    QueuedSample sample = std::move(ring_.front());
    ring_.pop_front();
    ring_bytes_ -= sample.memory();
    if (subscriptions_->topic(sample.topic).qos.latched) in_force_.insert_or_assign(sample.topic, std::move(sample));
  }
}

Result<void> Recorder::write_snapshots() {
  if (options_.ring.count() == 0 && triggers_.exchange(0) > 0 && watcher_.on_warning) {
    watcher_.on_warning("a trigger without --ring does nothing: everything is recorded anyway");
  }
  if (options_.ring.count() == 0 || triggers_.load() == 0) return {};
  triggers_ = 0;  // those that came together want the same
  forget_old(wall_clock());
  if (ring_.empty() && in_force_.empty()) {
    if (watcher_.on_warning) watcher_.on_warning("the ring is empty: nothing was written");
    return {};
  }
  const std::filesystem::path folder = next_folder();
  auto writer_result = bag::BagWriter::create(folder, options_.bag);
  if (!writer_result) return writer_result.error();
  ++snapshots_;
  bags_.push_back(folder);
  OpenBag snapshot(std::move(writer_result).value(), *subscriptions_);
  const bag::Time begin = ring_.empty() ? wall_clock() : ring_.front().log_time;
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
  auto closed = snapshot.writer().close();
  snapshot_bytes_ += snapshot.writer().bytes();
  if (result) result = closed;
  if (result && watcher_.on_snapshot) watcher_.on_snapshot(folder);
  return result;
}

Result<void> Recorder::check_disk() {
  unchecked_ = 0;
  auto free_result = free_disk(options_.folder);
  if (!free_result) return free_result.error();
  if (*free_result >= options_.min_free) return {};
  return Error{Code::kIo, fmt::format("{}: got {:.0f} MiB of free disk, wanted at least {:.0f}; make room, or say --min-free",
                                      options_.folder.string(), mebibytes(*free_result), mebibytes(options_.min_free))};
}

std::uint64_t Recorder::lost(int topic) const {
  const auto place = static_cast<std::size_t>(topic);
  const std::uint64_t unwritten = place < unwritten_.size() ? unwritten_[place] : 0;
  return subscriptions_->missing(topic) + queue_.overflowed(topic) + unwritten;
}

bag::Note Recorder::lost_note() const {
  bag::Note note;
  for (int topic = 0; topic < topics(); ++topic) note[subscriptions_->topic(topic).name] = std::to_string(lost(topic));
  return note;
}

RecordStatus Recorder::status() const {
  RecordStatus status{.seconds = std::chrono::duration<double>(Clock::now() - started_).count()};
  status.messages = bag_ ? messages_ : ring_.size();
  status.bytes = bag_ ? bag_->writer().bytes() : ring_bytes_;
  for (int topic = 0; topic < topics(); ++topic) status.lost += lost(topic);
  status.topics = static_cast<int>(std::ranges::count_if(written_, [](std::uint64_t count) { return count > 0; }));
  if (auto free_result = free_disk(options_.folder)) status.free_disk = *free_result;
  return status;
}

// After a failed write: what was written since the last flush may or may not be on the disk.
void Recorder::count_unsafe() {
  safe_.resize(written_.size());
  for (std::size_t topic = 0; topic < written_.size(); ++topic) {
    const std::uint64_t unsafe = written_[topic] - safe_[topic];
    unwritten_[topic] += unsafe;
    written_[topic] -= unsafe;
    messages_ -= unsafe;
  }
}

RecordReport Recorder::finish(std::string reason, std::optional<Error> problem) {
  trigger_reader_.reset();
  subscriptions_->close();
  // What came before the end belongs to it; after a problem it is counted as lost.
  auto rest = queue_.take(Clock::now(), {});
  if (problem) {
    for (const QueuedSample& sample : rest) {
      const auto place = static_cast<std::size_t>(sample.topic);
      if (unwritten_.size() <= place) written_.resize(place + 1), unwritten_.resize(place + 1);
      ++unwritten_[place];
    }
  } else if (auto ok = take_in(std::move(rest)); !ok) {
    problem = ok.error();
  }
  if (!problem) {
    if (auto ok = write_snapshots(); !ok) problem = ok.error();
  }
  RecordReport report{.reason = std::move(reason)};
  if (bag_) {
    if (problem) count_unsafe();
    bag_->writer().set_note("lost", lost_note());
    if (auto ok = bag_->writer().close(); !ok && !problem) problem = ok.error();
  }
  report.bags = bags_;
  report.status = status();
  if (!bag_) report.status.bytes = snapshot_bytes_;
  for (int topic = 0; topic < topics(); ++topic) {
    const auto place = static_cast<std::size_t>(topic);
    report.topics[subscriptions_->topic(topic).name] = {.messages = place < written_.size() ? written_[place] : 0,
                                                        .lost = lost(topic)};
  }
  report.problem = std::move(problem);
  return report;
}

}  // namespace jostle::services
