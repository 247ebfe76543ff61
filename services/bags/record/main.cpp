// jostle record: topics into a bag.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <chrono>
#include <csignal>
#include <ctime>
#include <mutex>
#include <nlohmann/json.hpp>

#include "services/bags/record/recorder.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/common/terminal/live_line.hpp"

namespace {

using namespace jostle;
using namespace jostle::bags;

struct Arguments {
  std::vector<std::string> topics, excluded, messages;
  std::string folder, storage = "mcap", json;
  bool no_compress = false;
  double ring = 0.0, duration = 0.0, split_time = 0.0;  // s
};

std::string now_as(const char* format) {
  const std::time_t now = std::time(nullptr);
  char text[64] = "";
  std::strftime(text, sizeof text, format, std::localtime(&now));
  return text;
}

std::chrono::nanoseconds seconds(double count) {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::duration<double>(count));
}

std::string host() {
  char name[256] = "";
  gethostname(name, sizeof name - 1);
  return name;
}

std::string size_text(std::uint64_t bytes) {
  const double mebibytes = static_cast<double>(bytes) / (1 << 20);
  return mebibytes < 1024 ? fmt::format("{:.1f} MiB", mebibytes) : fmt::format("{:.1f} GiB", mebibytes / 1024);
}

// Counts of seconds, in the words of all our errors; CLI11's own show the largest number there is.
CLI::Validator seconds_from(double least) {
  return CLI::Validator(
      [least](std::string& text) -> std::string {
        double value = 0.0;
        constexpr double kMost = 1e9;  // 32 years
        if (CLI::detail::lexical_cast(text, value) && value >= least && value <= kMost) return {};
        return fmt::format("got {}, wanted {} s or more", text, least);
      },
      "SECONDS");
}

CLI::Validator bytes_from(std::uint64_t least) {
  return CLI::Validator(
      [least](std::string& text) -> std::string {
        std::uint64_t value = 0;
        if (CLI::detail::lexical_cast(text, value) && value >= least) return {};
        return fmt::format("got {} bytes, wanted {} or more", text, least);
      },
      "");
}

constexpr double kShortest = 0.001;    // s
constexpr double kShortestPart = 0.1;  // s, and bytes: smaller parts hold a message each
constexpr std::uint64_t kSmallestPart = 10'000;

// A line that is drawn over and over in a terminal; nothing where the output is a file.
// Threads: any.
class Line {
 public:
  void show(const RecordStatus& status) {
    const std::lock_guard lock(mutex_);
    const double rate =
        (static_cast<double>(status.messages) - static_cast<double>(messages_)) / (status.seconds - seconds_);
    messages_ = status.messages;
    seconds_ = status.seconds;
    line_.draw(fmt::format("{:8.1f} s  {:>9} messages of {:>2} topics  {:>7.0f}/s  {:>10}  lost {}  disk free {}",
                           status.seconds, status.messages, status.topics, std::max(rate, 0.0), size_text(status.bytes),
                           status.lost, size_text(status.free_disk)));
  }

  template <class... T>
  void say(fmt::format_string<T...> format, T&&... values) {
    const std::lock_guard lock(mutex_);
    line_.say(format, std::forward<T>(values)...);
  }

 private:
  std::mutex mutex_;  // guards the terminal: warnings come from several threads
  common::LiveLine line_{"jostle record"};
  std::uint64_t messages_ = 0;
  double seconds_ = 0.0;
};

// CPU time of this process, all threads.
double cpu_seconds() {
  timespec used{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &used);
  return static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
}

nlohmann::json to_json(const RecordReport& report) {
  nlohmann::json json{{"bags", nlohmann::json::array()},
                      {"seconds", report.status.seconds},
                      {"messages", nlohmann::json::object()},
                      {"lost", nlohmann::json::object()},
                      {"bytes", report.status.bytes},
                      {"cpu_seconds", cpu_seconds()},
                      {"worst_write_seconds", report.status.worst_write},
                      {"reason", report.reason},
                      {"problem", report.problem ? report.problem->message : ""}};
  for (const auto& bag : report.bags) json["bags"].push_back(bag.string());
  for (const auto& [topic, count] : report.topics) {
    json["messages"][topic] = count.messages;
    json["lost"][topic] = count.lost;
  }
  return json;
}

// Signal handlers need it as a global.
std::atomic<Recorder*> snapshooter = nullptr;

void on_trigger(int) {
  if (Recorder* recorder = snapshooter.load()) recorder->trigger();
}

int record(RecordOptions options, const std::string& json, std::stop_token stop) {
  Line line;
  const bool with_ring = options.ring.count() > 0;
  const std::string folder = options.folder.string();
  auto recorder_result = Recorder::start(std::move(options),
                                         {.on_warning = [&](const std::string& text) { line.say("{}", text); },
                                          .on_progress = [&](const RecordStatus& status) { line.show(status); },
                                          .on_snapshot = [&](const auto& bag) { line.say("wrote {}", bag.string()); }});
  if (!recorder_result) {
    line.say("{}", recorder_result.error().message);
    return common::exit_code_of(recorder_result.error());
  }
  Recorder& recorder = **recorder_result;
  snapshooter = &recorder;
  // Whoever started this program waits for the word "ready".
  line.say("ready: domain {}, {} topics so far, {}", recorder.domain(), recorder.topics(),
           with_ring ? fmt::format("{}-1 and so on when told to: kill -USR1 {}, or /record/trigger", folder, getpid())
                     : fmt::format("into {}", folder));
  const RecordReport report = recorder.run(std::move(stop));
  snapshooter = nullptr;
  for (const auto& [topic, count] : report.topics) {
    if (count.lost > 0) line.say("{}: lost {} beside {} recorded", topic, count.lost, count.messages);
  }
  if (report.problem) line.say("{}", report.problem->message);
  line.say("{}: {} messages of {} topics in {:.1f} s, {}, lost {}", report.reason, report.status.messages,
           report.status.topics, report.status.seconds, size_text(report.status.bytes), report.status.lost);
  if (!json.empty()) {
    if (auto ok = common::write_text(json, to_json(report).dump(2) + "\n"); !ok) {
      line.say("{}", ok.error().message);
      return common::kExitBroken;
    }
  }
  return report.problem ? common::kExitBroken : common::kExitOk;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Records topics of this system and of ROS 2 into a bag until it is told to end. Subscribes to the\n"
      "system's own topics before anybody publishes them, and to others as they appear.",
      "jostle record");
  Arguments arguments;
  RecordOptions options;
  common::ProcessOptions process;
  app.add_option("topics", arguments.topics, "Globs of topics, such as '/robot/*'; * goes past slashes (default: all)");
  app.add_option("-o,--output", arguments.folder, "Folder of the bag (default: record_ and date and time)");
  app.add_option("--exclude", arguments.excluded,
                 "Globs of topics to leave out (default: /pool/*, unless topics are given)");
  app.add_option("--messages", arguments.messages,
                 "Folder with .msg files of types of your own, FOLDER/pkg/msg/Name.msg; may be given again\n"
                 "(AMENT_PREFIX_PATH is looked through, too)")
      ->allow_extra_args(false);
  app.add_option("--storage", arguments.storage, "mcap, or sqlite3 for tools that read nothing else")
      ->capture_default_str()
      ->check(CLI::IsMember({"mcap", "sqlite3"}));
  app.add_flag("--no-compress", arguments.no_compress, "Plain MCAP: three times the size, less processor time");
  const CLI::AsSizeValue bytes(false);
  app.add_option("--split-size", options.bag.split_bytes, "A new file after so many bytes, such as 500MB")
      ->transform(bytes)
      ->check(bytes_from(kSmallestPart));
  app.add_option("--split-time", arguments.split_time, "A new file after so many seconds")
      ->check(seconds_from(kShortestPart));
  auto* ring =
      app.add_option("--ring", arguments.ring,
                     "Keep the last so many seconds in memory; SIGUSR1, or a std_msgs/msg/Empty on /record/trigger, "
                     "writes them\ninto FOLDER-1, the next time into FOLDER-2, and so on")
          ->check(seconds_from(kShortest));
  app.add_option("--max-memory", options.max_memory,
                 "Bytes of samples in memory: what waits to be written, and the ring")
      ->default_str("256MiB")
      ->transform(bytes);
  app.add_option("--min-free", options.min_free, "End before less than so many bytes of the disk are free; 0: never")
      ->default_str("512MiB")
      ->transform(bytes);
  app.add_option("--duration", arguments.duration, "End after so many seconds")->check(seconds_from(kShortest));
  app.add_flag("--until-result", options.until_result, "End after a task's result")->excludes(ring);
  app.add_option("--json", arguments.json, "File for what was recorded and lost, by topic");
  common::add_process_options(app, process);
  app.footer(
      "Exit codes: 0 recorded, 2 bad input, 3 the disk is full or a part of the system failed. What was lost is\n"
      "counted by topic, shown, and stored in the bag; losses change no exit code.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  if (auto ok = common::check_outputs({{.option = "--json", .path = arguments.json, .endings = {}}}); !ok) {
    fmt::print(stderr, "jostle record: {}\n", ok.error().message);
    return common::exit_code_of(ok.error());
  }
  auto messages_result = message_files(arguments.messages);
  if (!messages_result) {
    fmt::print(stderr, "jostle record: {}\n", messages_result.error().message);
    return common::exit_code_of(messages_result.error());
  }
  options.messages = std::move(messages_result).value();
  common::die_with_parent(process.parent);
  options.domain = process.domain;
  options.folder = arguments.folder.empty() ? now_as("record_%Y_%m_%d-%H_%M_%S") : arguments.folder;
  options.selection = {.topics = arguments.topics, .excluded = arguments.excluded};
  if (arguments.topics.empty() && arguments.excluded.empty()) options.selection.excluded = {"/pool/*"};
  options.bag.storage = arguments.storage == "mcap" ? BagOptions::Storage::kMcap : BagOptions::Storage::kSqlite;
  options.bag.compress = !arguments.no_compress;
  options.bag.split_time = seconds(arguments.split_time);
  options.ring = seconds(arguments.ring);
  options.duration = seconds(arguments.duration);
  std::vector<std::string> words(argv + 1, argv + argc);
  options.note = {{"version", JOSTLE_VERSION},
                  {"host", host()},
                  {"start", now_as("%FT%T%z")},
                  {"options", fmt::format("{}", fmt::join(words, " "))}};
  const common::StopSignal signal;
  std::signal(SIGUSR1, on_trigger);
  std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error like a full disk
  try {
    return record(std::move(options), arguments.json, signal.token());
  } catch (const std::exception& error) {  // no memory
    fmt::print(stderr, "jostle record: {}\n", error.what());
    return common::kExitBroken;
  }
}
