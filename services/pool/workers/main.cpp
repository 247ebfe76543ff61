// jostle workers: which workers there are in a domain, and whom they serve.

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <mutex>

#include "services/common/process/program.hpp"
#include "services/pool/workers/roll.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"

namespace {

using namespace jostle;
using namespace jostle::pool;
using Clock = std::chrono::steady_clock;

constexpr std::chrono::seconds kPeriod{1};  // of --watch

struct Arguments {
  bool json = false, watch = false;
  double seconds = 2.0;
};

void print(const std::vector<WorkerLine>& lines, const Arguments& arguments) {
  if (arguments.json) {
    fmt::print("{}\n", to_json(lines).dump(arguments.watch ? -1 : 2));
  } else {
    if (arguments.watch && isatty(STDOUT_FILENO)) fmt::print("\x1b[H\x1b[2J");  // from the top of an empty screen
    fmt::print("{}", to_table(lines));
    if (arguments.watch) fmt::print("{} workers\n", lines.size());
  }
  std::fflush(stdout);
}

int list_workers(const wire::Participant& participant, const Arguments& arguments, std::stop_token stop) {
  std::mutex mutex;  // guards roll
  Roll roll([&](std::uint64_t id) { return participant.find(id); });
  const wire::Reader<jostle_msgs::msg::WorkerHeartbeat> reader(
      participant, wire::topics::kPoolWorker,
      [&](const jostle_msgs::msg::WorkerHeartbeat& heartbeat, const wire::Origin& origin) {
        const std::lock_guard lock(mutex);
        roll.hear(heartbeat, origin.participant, Clock::now());
      });
  const auto call = [&] {
    const std::lock_guard lock(mutex);
    return roll.call(Clock::now());
  };
  auto next =
      Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(arguments.seconds));
  while (common::pause_until(next, stop)) {
    const auto lines = call();
    if (!arguments.watch && lines.empty()) {
      if (arguments.json) print(lines, arguments);
      fmt::print(stderr,
                 "jostle workers: no worker was heard for {:g} s on domain {}; start one with `jostle worker`, or see "
                 "`jostle doctor`{}\n",
                 arguments.seconds, participant.domain(), participant.possible_cause());
      return common::kExitFailed;
    }
    print(lines, arguments);
    if (!arguments.watch) return common::kExitOk;
    next += kPeriod;
  }
  return common::kExitInterrupted;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Lists the workers of a DDS domain: where they run, how busy they are and whom they serve.",
               "jostle workers");
  Arguments arguments;
  common::ProcessOptions process;
  app.add_flag("--json", arguments.json, "JSON on standard output; with --watch one line each second");
  app.add_flag("--watch", arguments.watch, "Again every second, until Ctrl-C");
  app.add_option("--seconds", arguments.seconds, "Listen for so long first")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 3600.0));
  common::add_process_options(app, process);
  app.footer(
      "busy: threads that simulate, of all; load: of the host, mean of a minute.\n"
      "Exit codes: 0 there are workers, 1 none was heard, 2 bad input, 3 a part of the system failed, 130 "
      "interrupted.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  common::die_with_parent(process.parent);
  const common::StopSignal signal;
  const auto participant_result = wire::Participant::open({.name = "jostle_workers", .domain = process.domain});
  if (!participant_result) {
    fmt::print(stderr, "jostle workers: {}\n", participant_result.error().message);
    return participant_result.error().code == Code::kUnavailable ? common::kExitBroken : common::kExitUsage;
  }
  try {
    return list_workers(*participant_result, arguments, signal.token());
  } catch (const wire::SetupError& error) {
    fmt::print(stderr, "jostle workers: {}\n", error.what());
    return common::kExitBroken;
  }
}
