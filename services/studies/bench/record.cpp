#include "services/studies/bench/record.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>
#include <span>
#include <thread>
#include <utility>
#include <vector>

#include "services/bags/format/bag_reader.hpp"
#include "services/bags/format/bag_writer.hpp"
#include "services/bags/format/definitions.hpp"
#include "services/common/process/child_process.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/bench/catalogue.hpp"
#include "services/studies/bench/measurement.hpp"
#include "services/studies/bench/run_process.hpp"
#include "services/studies/bench/workload.hpp"
#include "services/wire/dds/names.hpp"
#include "services/wire/dds/raw.hpp"

namespace jostle::studies {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;
using nlohmann::json;
using Bytes = std::vector<std::byte>;

constexpr const char* kTopic = "/bench/record";
constexpr const char* kType = "sensor_msgs/msg/JointState";
// What a writer keeps for readers that are behind: at 20,000 messages per second 0.4 s.
constexpr Qos kPace{.depth = 8192};
constexpr int kPositions = 124;                // doubles: the message has 1028 bytes
constexpr int kVariants = 1024;                // messages made beforehand, sent in turns
constexpr std::chrono::milliseconds kBeat{1};  // of the publisher: what is due goes out in a burst
constexpr std::chrono::seconds kPatience{30};
constexpr std::chrono::seconds kVisit{1};  // of a recorder beside a plan
constexpr int kLoopSeconds = 3;            // of the loops beside it

// CDR of joint states whose positions are noise, which does not compress; the stamp has room
// for a number.
std::vector<Bytes> make_messages() {
  std::mt19937_64 noise(1);
  std::uniform_real_distribution<double> position(-3.0, 3.0);
  std::vector<Bytes> messages;
  sensor_msgs::msg::JointState state;
  wire::Serializer<sensor_msgs::msg::JointState> serializer;
  for (int i = 0; i < kVariants; ++i) {
    state.position().clear();
    for (int k = 0; k < kPositions; ++k) state.position().push_back(position(noise));
    eprosima::fastrtps::rtps::SerializedPayload_t payload(serializer.getSerializedSizeProvider(&state)());
    serializer.serialize(&state, &payload);
    const auto* begin = reinterpret_cast<const std::byte*>(payload.data);
    messages.emplace_back(begin, begin + payload.length);
  }
  return messages;
}

constexpr std::size_t kStamp = 4;  // offset in the message, behind the encapsulation

std::span<const std::byte> numbered(std::vector<Bytes>& messages, std::uint64_t number) {
  Bytes& message = messages[number % messages.size()];
  std::memcpy(message.data() + kStamp, &number, sizeof number);
  return message;
}

std::uint64_t number_of(const Bytes& message) {
  std::uint64_t number = 0;
  std::memcpy(&number, message.data() + kStamp, sizeof number);
  return number;
}

// Durations of many calls, in microseconds; null without calls.
json delays(const std::vector<double>& micros) {
  return {{"median", common::number_or_null(common::quantile(micros, 0.5))},
          {"p99", common::number_or_null(common::quantile(micros, 0.99))},
          {"worst", common::number_or_null(common::quantile(micros, 1.0))}};
}

double micros_since(Clock::time_point begin) { return 1e6 * seconds_since(begin); }

// Appends messages until time is up, and times every call.
template <class Append>
Result<json> loop(Append append) {
  std::vector<Bytes> messages = make_messages();
  std::vector<double> micros;
  const auto begin = Clock::now();
  std::uint64_t number = 0;
  const double cpu = own_cpu_seconds();
  while (seconds_since(begin) < kLoopSeconds) {
    const auto message = numbered(messages, number++);
    const auto call = Clock::now();
    if (Result<void> ok = append(message); !ok) return ok.error();
    micros.push_back(micros_since(call));
  }
  const double seconds = seconds_since(begin);
  return json{{"messages", number},
              {"per_second", static_cast<double>(number) / seconds},
              {"append_us", delays(micros)},
              {"cpu_us_per_message", 1e6 * (own_cpu_seconds() - cpu) / static_cast<double>(number)}};
}

Result<json> bare_loop(const fs::path& folder) {
  const fs::path path = folder / "bare";
  const int file = open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  auto result = loop([&](std::span<const std::byte> message) -> Result<void> {
    if (write(file, message.data(), message.size()) == static_cast<ssize_t>(message.size())) return {};
    return Error{Code::kIo, fmt::format("{}: {}", path.string(), std::strerror(errno))};
  });
  close(file);
  fs::remove(path);
  return result;
}

Result<json> bag_loop(const fs::path& folder, bool compress) {
  const fs::path path = folder / "loop";
  auto writer_result = bags::BagWriter::create(path, {.compress = compress});
  if (!writer_result) return writer_result.error();
  bags::BagWriter& writer = **writer_result;
  auto topic_result =
      writer.add_topic({.name = kTopic, .type = kType, .qos = kPace, .definition = *bags::definition_of(kType)});
  if (!topic_result) return topic_result.error();
  std::uint32_t sequence = 0;
  auto result = loop([&](std::span<const std::byte> message) {
    const std::chrono::nanoseconds now = std::chrono::system_clock::now().time_since_epoch();
    return writer.write(*topic_result, {now.count(), now.count(), ++sequence, message});
  });
  if (auto ok = writer.close(); !ok) return ok.error();
  fs::remove_all(path);
  return result;
}

// What the bag says itself.
struct ReadBack {
  std::uint64_t messages = 0, missing = 0;
  std::vector<double> delay_us;  // from the publisher's clock to the recorder's; one host
};

Result<ReadBack> read_back(const fs::path& folder, std::uint64_t sent) {
  auto reader_result = bags::BagReader::open(folder);
  if (!reader_result) return reader_result.error();
  ReadBack found;
  std::vector<bool> seen(sent);
  for (;;) {
    auto message_result = (*reader_result)->next();
    if (!message_result) return message_result.error();
    if (!*message_result) break;
    const bags::Message& message = **message_result;
    const std::uint64_t number = number_of(message.data);
    if (number < sent && !seen[number]) seen[number] = true, ++found.messages;
    found.delay_us.push_back(1e-3 * static_cast<double>(message.log_time - message.publish_time));
  }
  found.missing = sent - found.messages;
  return found;
}

Result<json> read_json(const fs::path& file) {
  auto text_result = common::read_text(file);
  if (!text_result) return text_result.error();
  json parsed = json::parse(*text_result, nullptr, false);
  if (parsed.is_discarded()) return Error{Code::kIo, file.string() + ": no JSON"};
  return parsed;
}

Result<common::ChildProcess> start_recorder(const fs::path& folder, int domain) {
  std::error_code ignored;
  fs::remove(folder.string() + ".log", ignored);  // of an earlier one, which was ready, too
  auto process_result =
      common::ChildProcess::start(common::program_folder() / "jostle_record",
                                  {"--output", folder.string(), "--json", folder.string() + ".json", "--domain",
                                   std::to_string(domain), "--die-with-parent", std::to_string(getpid())},
                                  folder.string() + ".log");
  if (!process_result) return process_result.error();
  common::ChildProcess recorder = std::move(process_result).value();
  const auto begin = Clock::now();
  while (!recorder.has_said("ready")) {
    if (recorder.wait_for(std::chrono::milliseconds(20)) || Clock::now() - begin > kPatience) {
      return Error{Code::kUnavailable, "the recorder is not ready:\n" + recorder.last_words()};
    }
  }
  return recorder;
}

Result<void> stop_recorder(common::ChildProcess& recorder) {
  recorder.terminate();
  const auto ended = recorder.wait_for(kPatience);
  if (ended && ended->ok()) return {};
  return Error{Code::kUnavailable,
               fmt::format("the recorder: {}\n{}", ended ? ended->text() : "does not end", recorder.last_words())};
}

// What is shown of the pace's progress.
std::size_t seconds_of(const RecordBenchOptions& options) {
  return static_cast<std::size_t>(std::ceil(options.seconds));
}

Result<json> at_pace(const RecordBenchOptions& options, const fs::path& folder) {
  const fs::path bag = folder / "bag", words = folder / "publisher.json";
  auto recorder_result = start_recorder(bag, options.domain);
  if (!recorder_result) return recorder_result.error();
  auto publisher_result = common::ChildProcess::start(
      common::program_folder() / "jostle_bench",
      {"publish", "--rate", fmt::format("{}", options.rate), "--seconds", fmt::format("{}", options.seconds), "--json",
       words.string(), "--domain", std::to_string(options.domain)},
      folder / "publisher.log");
  if (!publisher_result) return publisher_result.error();
  const auto patience = std::chrono::milliseconds(static_cast<long>(1e3 * options.seconds)) + kPatience;
  const auto begin = Clock::now();
  bool interrupted = false;
  for (std::size_t shown = 0; !publisher_result->wait_for(std::chrono::milliseconds(100));) {
    for (; shown < seconds_of(options) && seconds_since(begin) > static_cast<double>(shown + 1); ++shown)
      options.line->step();
    // The publisher says what it has sent so far, which counts.
    if (options.stop.stop_requested() && !std::exchange(interrupted, true)) publisher_result->terminate();
    if (Clock::now() - begin > patience) return Error{Code::kUnavailable, "the publisher does not end"};
  }
  if (const common::ExitStatus ended = *publisher_result->ended(); !ended.ok()) {
    return Error{Code::kUnavailable, "the publisher: " + ended.text() + "\n" + publisher_result->last_words()};
  }
  if (auto ok = stop_recorder(*recorder_result); !ok) return ok.error();
  auto published_result = read_json(words), recorded_result = read_json(bag.string() + ".json");
  if (!published_result) return published_result.error();
  if (!recorded_result) return recorded_result.error();
  auto back_result = read_back(bag, (*published_result)["sent"]);
  if (!back_result) return back_result.error();
  const json& recorded = *recorded_result;
  return json{{"interrupted", interrupted},
              {"publisher", *published_result},
              {"recorded", recorded["messages"].value(kTopic, 0)},
              {"lost_by_counters", recorded["lost"].value(kTopic, 0)},
              {"read_back", back_result->messages},
              {"missing_by_numbers", back_result->missing},
              {"bytes", recorded["bytes"]},
              {"recorder_cpu_seconds", recorded["cpu_seconds"]},
              {"worst_write_us", 1e6 * recorded["worst_write_seconds"].get<double>()},
              {"delay_us", delays(back_result->delay_us)}};
}

std::string number_of(const json& value) {
  return common::number_text(value.is_null() ? common::kNone : value.get<double>(), 1);
}

void print_delays(const char* what, const json& delays) {
  fmt::print("  {:<30} median {:>8} us   99 % {:>9} us   worst {:>9} us\n", what, number_of(delays["median"]),
             number_of(delays["p99"]), number_of(delays["worst"]));
}

void print_pace(const json& live) {
  const json& published = live["publisher"];
  const double seconds = published["seconds"];
  fmt::print("record: {}{} messages of 1028 bytes in {:.1f} s, {:.0f}/s\n",
             live["interrupted"].get<bool>() ? "interrupted: " : "", published["sent"].get<std::uint64_t>(), seconds,
             published["sent"].get<double>() / seconds);
  fmt::print("  recorded {}, lost by its counters {}; in the bag {}, missing by their numbers {}\n",
             live["recorded"].get<std::uint64_t>(), live["lost_by_counters"].get<std::uint64_t>(),
             live["read_back"].get<std::uint64_t>(), live["missing_by_numbers"].get<std::uint64_t>());
  fmt::print("  processor time: publisher {:.2f}, recorder {:.2f} s per s\n",
             published["cpu_seconds"].get<double>() / seconds, live["recorder_cpu_seconds"].get<double>() / seconds);
  print_delays("the publisher's write()", published["write_us"]);
  print_delays("from write() to the recorder", live["delay_us"]);
  fmt::print("  {:<58} worst {:>9.1f} us\n", "the recorder's write to the bag", live["worst_write_us"].get<double>());
}

void print_loop(const char* name, const json& loop) {
  fmt::print("  {:<26} {:>9.0f}/s, {:.2f} us of processor time per message\n", name, loop["per_second"].get<double>(),
             loop["cpu_us_per_message"].get<double>());
  print_delays("   append", loop["append_us"]);
}

Result<void> disturbance(const RecordBenchOptions& options, const fs::path& folder) {
  auto scene_result = clutter(5);
  if (!scene_result) return scene_result.error();
  if (auto ok = common::write_text(folder / "scene.yaml", physics_pool::to_yaml(*scene_result)); !ok) return ok;
  if (auto ok = common::write_text(folder / "parameters.yaml",
                                   "objective: {success_cost: 1.0e-9}\ncontrol: {many_iterations: 4}\n");
      !ok) {
    return ok;
  }
  // Comes in the middle, is stopped, and comes again: the middleware of everybody finds and
  // forgets it each time.
  const auto visit = [&](common::ChildProcess& planning) -> Result<void> {
    const fs::path bag = folder / "bag";
    fs::remove_all(bag);
    auto recorder_result = start_recorder(bag, options.domain);
    if (!recorder_result) return recorder_result.error();
    planning.wait_for(kVisit);
    return stop_recorder(*recorder_result);
  };
  const auto alone = [&](common::ChildProcess& planning) -> Result<void> {
    planning.wait_for(kVisit);
    return {};
  };
  const RunProcess run{.folder = folder,
                       .arguments = {(folder / "scene.yaml").string(), "--plan-only", "--seed", "7", "--parameters",
                                     (folder / "parameters.yaml").string()},
                       .seconds = "plan_seconds",
                       .domain = options.domain,
                       .stop = options.stop};
  const Turns turns{.repeats = options.pairs, .stop = options.stop, .cpu_seconds = children_cpu_seconds, .on_run = [&] {
                      options.line->step();
                    }};
  options.line->expect(static_cast<std::size_t>(turns.runs()));
  auto result = compare({"plan, recorded", [&] { return run_once(run, visit); }},
                        {"plan alone", [&] { return run_once(run, alone); }}, turns);
  if (!result) return result.error();
  result->name = "record-disturbance";
  result->unit = "s";
  options.line->end();
  fmt::print("{}", to_text(*result));
  if (!options.json.empty()) {
    if (auto ok = common::write_results(options.json, to_json({*result})); !ok) return ok;
  }
  return options.stop.stop_requested() ? Result<void>(Error{Code::kCancelled, "interrupted"}) : Result<void>();
}

// At the pace first, then the loops; `all` has what was finished.
Result<void> measure_all(const RecordBenchOptions& options, const fs::path& folder, json& all) {
  const std::pair<const char*, std::function<Result<json>()>> loops[] = {
      {"bare_loop", [&] { return bare_loop(folder); }},
      {"bag_loop", [&] { return bag_loop(folder, true); }},
      {"plain_bag_loop", [&] { return bag_loop(folder, false); }}};
  options.line->expect(seconds_of(options) + std::size(loops) * kLoopSeconds);
  auto pace_result = at_pace(options, folder);
  if (!pace_result) return pace_result.error();
  all["pace"] = *pace_result;
  fs::remove_all(folder / "bag");
  for (const auto& [key, run] : loops) {
    if (options.stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
    auto loop_result = run();
    if (!loop_result) return loop_result.error();
    all[key] = *loop_result;
    for (int i = 0; i < kLoopSeconds; ++i) options.line->step();
  }
  return {};
}

Result<void> measure(const RecordBenchOptions& options, const fs::path& folder) {
  if (options.pairs > 0) return disturbance(options, folder);
  json all;
  auto measured = measure_all(options, folder, all);
  options.line->end();
  if (all.contains("pace")) print_pace(all["pace"]);
  for (const auto& [name, key] : {std::pair{"bare append loop", "bare_loop"}, std::pair{"bag loop", "bag_loop"},
                                  std::pair{"bag loop, not compressed", "plain_bag_loop"}}) {
    if (all.contains(key)) print_loop(name, all[key]);
  }
  if (options.json.empty() || all.empty()) return measured;
  if (auto ok = common::write_results(options.json, all); !ok) return ok;
  return measured;
}

}  // namespace

Result<void> bench_record(const RecordBenchOptions& options) {
  auto folder_result = common::make_temporary_folder("bench-record");
  if (!folder_result) return folder_result.error();
  auto measured = measure(options, *folder_result);
  std::error_code ignored;
  fs::remove_all(*folder_result, ignored);
  return measured;
}

int publish_for_record(const RecordBenchOptions& options) {
  common::die_with_parent(getppid());
  auto participant_result = wire::Participant::open({.name = "jostle_bench_publish", .domain = options.domain});
  if (!participant_result) {
    fmt::print(stderr, "jostle bench: {}\n", participant_result.error().message);
    return common::kExitBroken;
  }
  std::vector<Bytes> messages = make_messages();
  wire::RawWriter writer(*participant_result, {wire::wire_topic(kTopic), *wire::wire_type(kType), kPace});
  if (!writer.wait_for_readers(Clock::now() + kPatience)) {
    fmt::print(stderr, "jostle bench: nobody reads {}\n", kTopic);
    return common::kExitBroken;
  }
  const auto wanted = static_cast<std::uint64_t>(options.rate * options.seconds);
  std::vector<double> micros;
  micros.reserve(wanted);
  std::uint64_t sent = 0, refused = 0;
  const double cpu = own_cpu_seconds();
  const auto begin = Clock::now();
  for (auto beat = begin; sent < wanted && !options.stop.stop_requested(); beat += kBeat) {
    std::this_thread::sleep_until(beat);
    const auto due = std::min(wanted, static_cast<std::uint64_t>(options.rate * seconds_since(begin)));
    while (sent < due) {
      const auto message = numbered(messages, sent++);
      const auto call = Clock::now();
      if (!writer.write(message)) ++refused;
      micros.push_back(micros_since(call));
    }
  }
  const double seconds = seconds_since(begin);
  const bool received = writer.wait_until_received(Clock::now() + kPatience);
  const json words{{"sent", sent},
                   {"refused", refused},
                   {"seconds", seconds},
                   {"received", received},
                   {"cpu_seconds", own_cpu_seconds() - cpu},
                   {"write_us", delays(micros)}};
  const auto ok = common::write_text(options.json, words.dump() + "\n");
  return ok && received ? common::kExitOk : common::kExitBroken;
}

namespace {

class Record : public Benchmark {
 public:
  Record() : Record("record", "the recorder at 20,000 messages per second, or what it costs a plan", "75 s") {}

  void add_options(CLI::App& app) override {
    add_pace(app);
    auto* disturbance =
        app.add_flag("--disturbance", disturbance_, "Measure the time of a plan with and without a recorder instead");
    app.add_option("--repeats", pairs_, "Pairs of plans of --disturbance")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000))
        ->needs(disturbance);
  }

  Result<int> run(const Start& start) override { return exit_code(bench_record(options_for(start))); }

  const char* unit() const override { return disturbance_ ? "plans" : "s"; }

 protected:
  Record(const char* its_name, const char* its_purpose, const char* it_takes)
      : Benchmark(its_name, its_purpose, it_takes, Uses::kDomain) {}

  void add_pace(CLI::App& app) {
    app.add_option("--rate", options_.rate, "Messages of 1 KiB per second")
        ->capture_default_str()
        ->check(CLI::Range(1.0, 1e6));
    app.add_option("--seconds", options_.seconds, "How long")->capture_default_str()->check(CLI::Range(0.1, 86400.0));
    add_json(app);
  }
  RecordBenchOptions options_for(const Start& start) const {
    RecordBenchOptions options = options_;
    if (disturbance_) options.pairs = pairs_;
    options.json = json;
    options.domain = start.domain;
    options.stop = start.stop;
    options.line = start.line;
    return options;
  }

 private:
  RecordBenchOptions options_;
  bool disturbance_ = false;
  int pairs_ = 9;
};

/// The other process of `record`.
class Publisher final : public Record {
 public:
  Publisher() : Record("publish", "", "") {}

  void add_options(CLI::App& app) override { add_pace(app); }
  Result<void> check() const override { return {}; }
  Result<int> run(const Start& start) override { return publish_for_record(options_for(start)); }
};

}  // namespace

std::unique_ptr<Benchmark> record_benchmark() { return std::make_unique<Record>(); }
std::unique_ptr<Benchmark> publisher_benchmark() { return std::make_unique<Publisher>(); }

}  // namespace jostle::studies
