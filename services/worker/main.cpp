// jostle worker: lends this machine's cores to the rollout pool.

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>

#include "services/pool_remote/worker_service.hpp"
#include "services/support/cores.hpp"
#include "services/support/program.hpp"

namespace {

using namespace jostle;
using namespace jostle::services;

int serve(const dds::ParticipantOptions& dds_options, const WorkerOptions& options, std::stop_token stop) {
  auto participant_result = dds::Participant::open(dds_options);
  if (!participant_result) {
    spdlog::error("{}", participant_result.error().message);
    return kExitUsage;
  }
  WorkerService worker(*participant_result, options);
  const std::string where = options.cores.empty() ? "" : fmt::format(", on cores {}", fmt::join(options.cores, ", "));
  spdlog::info("{}: {} rollouts at a time{}, domain {}", worker.name(), options.threads, where, participant_result->domain());
  wait_for(std::move(stop));
  return kExitOk;
}

// What --pin means; an empty list stands for all that this process may use.
Result<void> choose_cores(const std::string& list, bool threads_given, WorkerOptions& options) {
  std::vector<int> cores = allowed_cores();
  if (!list.empty()) {
    auto cores_result = parse_cores(list, cores);
    if (!cores_result) return cores_result.error();
    cores = std::move(cores_result).value();
    if (!threads_given) options.threads = static_cast<int>(cores.size());
  }
  auto cores_result = one_core_each(cores, options.threads);
  if (!cores_result) return cores_result.error();
  options.cores = std::move(cores_result).value();
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Runs rollouts for any planner in the same DDS domain until it is told to end.", "jostle worker");
  WorkerOptions options;
  dds::ParticipantOptions dds_options{.name = "jostle_worker"};
  ProcessOptions process;
  std::string pin;
  auto* threads = add_count_option(app, "--threads", options.threads, 1, "Rollouts at a time; auto: one per core this process may use")
                      ->default_str("1, or as many as --pin lists");
  auto* pinned = app.add_option("--pin", pin, "Keep each simulating thread on a core of its own: one of this list, such as\n"
                                              "2,3,6-8; without a list, one of those this process may use")
                     ->expected(0, 1)->type_name("[CORES]");
  app.add_option("--name", options.name, "As clients report it (default: host and process id)");
  add_process_options(app, process);
  if (const auto code = parse_arguments(app, argc, argv)) return *code;

  if (pinned->count() > 0) {
    if (auto ok = choose_cores(pin, threads->count() > 0, options); !ok) {
      fmt::print(stderr, "jostle worker: --pin: {}\n", ok.error().message);
      return kExitUsage;
    }
  }
  die_with_parent(process.parent);
  dds_options.domain = process.domain;
  const StopSignal signal;
  set_up_logging("worker");
  try {
    return serve(dds_options, options, signal.token());
  } catch (const std::exception& error) {  // the middleware's SetupError, a core that was taken away
    spdlog::error("{}", error.what());
    return kExitBroken;
  }
}
