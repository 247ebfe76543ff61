// How true playback is: what a subscriber in another process hears against what the bag says.

#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <mutex>
#include <nlohmann/json.hpp>
#include <random>

#include "services/bags/format/bag_writer.hpp"
#include "services/common/process/child_process.hpp"
#include "services/common/process/files.hpp"
#include "services/studies/bench/benchmarks.hpp"
#include "services/wire/dds/names.hpp"
#include "services/wire/dds/raw.hpp"

namespace jostle::studies {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using Bytes = std::vector<std::byte>;

constexpr int kMessages = 5000;   // 1000 per second, 5 s
constexpr double kMeanGap = 1e6;  // ns; gaps are exponential, so some are tiny
constexpr std::array kRates{0.1, 0.5, 1.0, 2.0, 10.0};
constexpr std::chrono::minutes kLongest{3};  // of one playback; the slowest takes 50 s
constexpr std::chrono::seconds kLastOnes{2};

struct TopicKind {
  const char* name;
  Qos qos;
  std::size_t bytes;
};
constexpr std::array<TopicKind, 5> kTopics{{{"/bench/joints", kState, 256},
                                            {"/bench/objects", kState, 2048},
                                            {"/bench/plan", kCommand, 16384},
                                            {"/bench/ticks", kCommand, 32},
                                            {"/bench/scan", kCommand, 1024}}};
constexpr const char* kType = "bench_msgs/msg/Block";

struct Planned {
  std::size_t topic = 0;
  bags::Time time = 0;
  Bytes data;  // CDR's four bytes, the message's number, noise
};

std::vector<Planned> make_messages() {
  std::mt19937_64 random(1);
  std::vector<Planned> messages;
  double time = 1.7e18;
  for (int i = 0; i < kMessages; ++i) {
    const std::size_t topic = random() % kTopics.size();
    Bytes data(kTopics[topic].bytes);
    for (std::byte& byte : data) byte = static_cast<std::byte>(random());
    constexpr std::array kEncapsulation{std::byte{0}, std::byte{1}, std::byte{0}, std::byte{0}};
    std::ranges::copy(kEncapsulation, data.begin());
    std::memcpy(data.data() + 4, &i, sizeof i);
    messages.push_back({topic, static_cast<bags::Time>(time), std::move(data)});
    const double uniform = (static_cast<double>(random() >> 11) + 0.5) * 0x1p-53;
    time += std::ceil(-kMeanGap * std::log(uniform) / 256) * 256;  // a double of this size counts in 256 ns
  }
  return messages;
}

Result<void> write_bag(const fs::path& folder, const std::vector<Planned>& messages) {
  auto writer_result = bags::BagWriter::create(folder, {});
  if (!writer_result) return writer_result.error();
  for (const TopicKind& topic : kTopics) {
    const auto added =
        (*writer_result)
            ->add_topic({.name = topic.name, .type = kType, .qos = topic.qos, .definition = "uint8[] data\n"});
    if (!added) return added.error();
  }
  for (const Planned& message : messages) {
    auto ok = (*writer_result)
                  ->write(static_cast<int>(message.topic),
                          {.log_time = message.time, .publish_time = message.time, .data = message.data});
    if (!ok) return ok;
  }
  return (*writer_result)->close();
}

Hash hash_of_all(std::vector<std::pair<int, std::span<const std::byte>>> messages) {
  std::ranges::sort(messages, {}, &std::pair<int, std::span<const std::byte>>::first);
  std::string all;
  for (const auto& [index, data] : messages) all.append(reinterpret_cast<const char*>(data.data()), data.size());
  return hash_of(std::string_view(all));
}

struct Arrival {
  int index = -1;
  Clock::time_point time;
  Bytes data;
};

// Hears all topics; one place for what comes, in the order in which it comes.
class Subscriber {
 public:
  explicit Subscriber(const wire::Participant& participant) {
    for (const TopicKind& topic : kTopics) {
      readers_.push_back(std::make_unique<wire::RawReader>(
          participant,
          wire::RawTopic{wire::wire_topic(topic.name), wire::wire_type(kType).value(), {.depth = kKeepAll}},
          [this](std::span<const std::byte> data, const wire::Origin&) { take(data); }));
    }
  }

  std::size_t count() const {
    const std::lock_guard lock(mutex_);
    return arrivals_.size();
  }
  std::vector<Arrival> take_all() {
    const std::lock_guard lock(mutex_);
    return std::exchange(arrivals_, {});
  }

 private:
  void take(std::span<const std::byte> data) {
    Arrival arrival{.time = Clock::now(), .data = {data.begin(), data.end()}};
    if (data.size() >= 8) std::memcpy(&arrival.index, data.data() + 4, sizeof arrival.index);
    const std::lock_guard lock(mutex_);
    arrivals_.push_back(std::move(arrival));
  }

  mutable std::mutex mutex_;  // guards arrivals_
  std::vector<Arrival> arrivals_;
  std::vector<std::unique_ptr<wire::RawReader>> readers_;  // last: stop before what they fill is gone
};

// Over the runs that count.
struct Findings {
  std::vector<double> spacing, offset;                    // ms, of every message
  std::vector<double> late_median, late_p99, late_worst;  // ms, as the player says, of every run
  std::size_t arrived = 0, pairs = 0, pairs_in_order = 0;
  int runs = 0;
  bool ordered = true;  // within every topic
};

double milliseconds(Clock::duration time) { return std::chrono::duration<double, std::milli>(time).count(); }

class PlayBench {
 public:
  PlayBench(const Settings& settings, fs::path folder)
      : settings_(settings), folder_(std::move(folder)), messages_(make_messages()) {}

  Result<void> run() {
    if (auto ok = write_bag(folder_ / "bag", messages_); !ok) return ok.error();
    auto participant_result = wire::Participant::open({.name = "jostle_bench_play", .domain = settings_.domain});
    if (!participant_result) return participant_result.error();
    subscriber_ = std::make_unique<Subscriber>(*participant_result);
    for (const double rate : kRates) {
      auto result = measure(rate);
      if (!result) return result.error();
      settings_.keep(*std::move(result));
    }
    return {};
  }

 private:
  Result<Measurement> measure(double rate) {
    Findings findings;
    Turns turns = settings_.turns();
    turns.cpu_seconds = cpu_with_children;
    auto result = compare({"as recorded", [&]() -> Result<Sample> { return as_recorded(rate); }},
                          {"as played", [&] { return play(rate, findings); }}, turns);
    if (!result) return result.error();
    result->name = fmt::format("play/{:g}", rate);
    result->unit = "ms";
    result->details = {
        {"runs", findings.runs},
        {"messages", static_cast<double>(kMessages) * findings.runs},
        {"share", static_cast<double>(findings.arrived) / (static_cast<double>(kMessages) * findings.runs)},
        {"order_within_topics", findings.ordered},
        {"order_across_topics", static_cast<double>(findings.pairs_in_order) / static_cast<double>(findings.pairs)},
        {"spacing_median_ms", common::median(findings.spacing)},
        {"spacing_p99_ms", common::quantile(findings.spacing, 0.99)},
        {"spacing_worst_ms", common::quantile(findings.spacing, 1.0)},
        {"offset_p99_ms", common::quantile(findings.offset, 0.99)},
        {"sent_late_median_ms", common::median(findings.late_median)},
        {"sent_late_p99_ms", common::median(findings.late_p99)},
        {"sent_late_worst_ms", common::quantile(findings.late_worst, 1.0)}};
    return result;
  }

  Sample as_recorded(double rate) const {
    std::vector<std::pair<int, std::span<const std::byte>>> all;
    for (int i = 0; i < kMessages; ++i) all.emplace_back(i, messages_[static_cast<std::size_t>(i)].data);
    return {.value = 1e-6 * static_cast<double>(messages_.back().time - messages_.front().time) / rate,
            .hash = hash_of_all(all)};
  }

  Result<Sample> play(double rate, Findings& findings) {
    subscriber_->take_all();
    const fs::path report = folder_ / "report.json";
    auto player_result = common::ChildProcess::start(
        common::program_folder() / "jostle_play",
        {(folder_ / "bag").string(), "--rate", fmt::format("{}", rate), "--wait-for-subscribers=1", "--json",
         report.string(), "--domain", std::to_string(settings_.domain), "--die-with-parent", std::to_string(getpid())},
        folder_ / "player.log");
    if (!player_result) return player_result.error();
    const auto end = Clock::now() + kLongest;
    while (!player_result->ended()) {
      if (settings_.stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
      if (Clock::now() >= end)
        return Error{Code::kUnavailable, "jostle_play: does not end: " + player_result->last_words()};
      usleep(20'000);
    }
    if (const common::ExitStatus ended = *player_result->ended(); !ended.ok()) {
      return Error{Code::kUnavailable, fmt::format("jostle_play: {}: {}", ended.text(), player_result->last_words())};
    }
    for (const auto last = Clock::now() + kLastOnes; subscriber_->count() < kMessages && Clock::now() < last;)
      usleep(1000);
    const auto arrivals = subscriber_->take_all();
    if (arrivals.size() < 2)
      return Error{Code::kUnavailable, fmt::format("got {} messages, wanted {}", arrivals.size(), kMessages)};
    if (const bool counts = runs_++ % (settings_.repeats + 1) != 0; counts) judge(arrivals, rate, report, findings);
    std::vector<std::pair<int, std::span<const std::byte>>> all;
    for (const Arrival& arrival : arrivals) all.emplace_back(arrival.index, arrival.data);
    return Sample{.value = milliseconds(arrivals.back().time - arrivals.front().time), .hash = hash_of_all(all)};
  }

  void judge(const std::vector<Arrival>& arrivals, double rate, const fs::path& report, Findings& findings) const {
    std::vector<std::optional<Clock::time_point>> times(kMessages);
    std::array<int, kTopics.size()> newest;
    newest.fill(-1);
    int before = -1;
    for (const Arrival& arrival : arrivals) {
      if (arrival.index < 0 || arrival.index >= kMessages) continue;  // the hash says so
      const auto index = static_cast<std::size_t>(arrival.index);
      times[index] = arrival.time;
      int& last = newest[messages_[index].topic];
      findings.ordered = findings.ordered && arrival.index > last;
      last = arrival.index;
      ++findings.pairs;
      findings.pairs_in_order += arrival.index > before;
      before = arrival.index;
    }
    findings.arrived += arrivals.size();
    ++findings.runs;
    for (std::size_t i = 1; i < times.size(); ++i) {
      if (!times[i]) continue;
      const auto wanted = [&](std::size_t from) {
        return 1e-6 * static_cast<double>(messages_[i].time - messages_[from].time) / rate;
      };
      if (times[i - 1]) findings.spacing.push_back(std::abs(milliseconds(*times[i] - *times[i - 1]) - wanted(i - 1)));
      if (times[0]) findings.offset.push_back(std::abs(milliseconds(*times[i] - *times[0]) - wanted(0)));
    }
    const auto text_result = common::read_text(report);
    const auto json = nlohmann::json::parse(text_result ? *text_result : "", nullptr, false);
    if (json.is_discarded()) return;
    findings.late_median.push_back(json["late_ms"]["median"]);
    findings.late_p99.push_back(json["late_ms"]["p99"]);
    findings.late_worst.push_back(json["late_ms"]["worst"]);
  }

  // Players that have ended included.
  static double cpu_with_children() {
    rusage usage{};
    getrusage(RUSAGE_CHILDREN, &usage);
    const auto seconds = [](const timeval& time) {
      return static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_usec);
    };
    return own_cpu_seconds() + seconds(usage.ru_utime) + seconds(usage.ru_stime);
  }

  const Settings& settings_;
  const fs::path folder_;
  const std::vector<Planned> messages_;
  std::unique_ptr<Subscriber> subscriber_;
  int runs_ = 0;  // runs: the first of each rate is not counted
};

}  // namespace

Result<void> measure_play(const Settings& settings) {
  settings.announce(static_cast<int>(std::size(kRates)));
  auto folder_result = common::make_temporary_folder("bench-play");
  if (!folder_result) return folder_result.error();
  auto result = PlayBench(settings, *folder_result).run();
  std::error_code ignored;
  fs::remove_all(*folder_result, ignored);
  return result;
}

}  // namespace jostle::studies
