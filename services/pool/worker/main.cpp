// jostle worker: lends this machine's cores to the rollout pool.

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <set>

#include "services/common/process/cores.hpp"
#include "services/common/process/presence.hpp"
#include "services/common/process/program.hpp"
#include "services/pool/worker/worker_service.hpp"

namespace {

using namespace jostle;
using namespace jostle::pool;

// The participant's lease less an announcement: who is not heard for that long is dropped.
constexpr std::chrono::milliseconds kPause{1500};

// Joins again, as somebody new, whenever others may have dropped it. The middleware looks for
// network interfaces once, when a participant is made, so a worker that came up before its
// network (at boot) would stay alone with itself. And where only one of two sides dropped the
// other (an outage of about a lease), they do not find each other again: Fast DDS 2.9.1, a
// worker that was stopped for 2.04 s and never heard again.
int serve(const wire::ParticipantOptions& dds_options, const WorkerOptions& options, std::stop_token stop) {
  while (!stop.stop_requested()) {
    const std::set<std::string> before = common::reachable_addresses();
    auto participant_result = wire::Participant::open(dds_options);
    std::set<std::string> known = common::reachable_addresses();
    std::erase_if(known, [&](const std::string& address) { return !before.contains(address); });  // too late, perhaps
    if (!participant_result) {
      spdlog::error("{}", participant_result.error().message);
      return common::exit_code_of(participant_result.error());
    }
    WorkerService worker(*participant_result, options);
    const std::string where = options.cores.empty() ? "" : fmt::format(", on cores {}", fmt::join(options.cores, ", "));
    spdlog::info("{}: {} rollouts at a time{}, domain {}", worker.name(), options.threads, where,
                 participant_result->domain());
    const std::string reason = common::wait_until_forgotten(known, kPause, stop);
    if (!reason.empty()) spdlog::info("{}: joins again: {}", worker.name(), reason);
  }
  return common::kExitOk;
}

// What --pin means; an empty list stands for all that this process may use.
Result<void> choose_cores(const std::string& list, bool threads_given, WorkerOptions& options) {
  std::vector<int> cores = common::allowed_cores();
  if (!list.empty()) {
    auto cores_result = common::parse_cores(list, cores);
    if (!cores_result) return cores_result.error();
    cores = std::move(cores_result).value();
    if (!threads_given) options.threads = static_cast<int>(cores.size());
  }
  auto cores_result = common::one_core_each(cores, options.threads);
  if (!cores_result) return cores_result.error();
  options.cores = std::move(cores_result).value();
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Runs rollouts for any planner in the same DDS domain until it is told to end.", "jostle worker");
  WorkerOptions options;
  wire::ParticipantOptions dds_options{.name = "jostle_worker", .role = wire::Role::kWorker, .waits_for_server = true};
  common::ProcessOptions process;
  std::string pin;
  auto* threads = common::add_count_option(app, "--threads", options.threads, 1,
                                           "Rollouts at a time; auto: one per core this process may use")
                      ->default_str("1, or as many as --pin lists");
  auto* pinned = app.add_option("--pin", pin,
                                "Keep each simulating thread on a core of its own: one of this list, such as\n"
                                "2,3,6-8; without a list, one of those this process may use")
                     ->expected(0, 1)
                     ->type_name("[CORES]");
  std::size_t megabytes = WorkerOptions::kMemory >> 20;
  app.add_option("--memory", megabytes, "MB of worlds and simulators that are kept for the next batch")
      ->capture_default_str()
      ->check(CLI::Range(std::size_t{1}, std::size_t{1} << 20));
  app.add_option("--name", options.name, "As clients report it (default: host and process id)");
  common::add_process_options(app, process);
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;

  if (pinned->count() > 0) {
    if (auto ok = choose_cores(pin, threads->count() > 0, options); !ok) {
      fmt::print(stderr, "jostle worker: --pin: {}\n", ok.error().message);
      return common::kExitUsage;
    }
  }
  options.memory = megabytes << 20;
  common::die_with_parent(process.parent);
  dds_options.domain = process.domain;
  const common::StopSignal signal;
  common::set_up_logging("worker");
  try {
    return serve(dds_options, options, signal.token());
  } catch (const std::exception& error) {  // the middleware's SetupError, a core that was taken away
    spdlog::error("{}", error.what());
    return common::kExitBroken;
  }
}
