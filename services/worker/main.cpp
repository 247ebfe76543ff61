// jostle worker: lends this machine's cores to the rollout pool.

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <condition_variable>
#include <mutex>

#include "services/pool_remote/worker_service.hpp"
#include "services/support/program.hpp"

namespace {

using namespace jostle;
using namespace jostle::services;

void wait_for(std::stop_token stop) {
  std::mutex mutex;
  std::condition_variable_any stopped;
  std::unique_lock lock(mutex);
  stopped.wait(lock, stop, [] { return false; });
}

int serve(const dds::ParticipantOptions& dds_options, const WorkerOptions& options, std::stop_token stop) {
  auto participant_result = dds::Participant::open(dds_options);
  if (!participant_result) {
    spdlog::error("{}", participant_result.error().message);
    return kExitUsage;
  }
  WorkerService worker(*participant_result, options);
  spdlog::info("{}: {} rollouts at a time, domain {}", worker.name(), options.threads,
               participant_result->domain());
  wait_for(std::move(stop));
  return kExitOk;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Runs rollouts for any planner in the same DDS domain until it is told to end.", "jostle worker");
  WorkerOptions options;
  dds::ParticipantOptions dds_options{.name = "jostle_worker"};
  ProcessOptions process;
  app.add_option("--threads", options.threads, "Rollouts at a time")
      ->capture_default_str()->check(CLI::Range(1, 1024));
  app.add_option("--name", options.name, "As clients report it (default: host and process id)");
  add_process_options(app, process);
  if (const auto code = parse_arguments(app, argc, argv)) return *code;

  die_with_parent(process.parent);
  dds_options.domain = process.domain;
  const StopSignal signal;
  set_up_logging("worker");
  try {
    return serve(dds_options, options, signal.token());
  } catch (const dds::SetupError& error) {
    spdlog::error("{}", error.what());
    return kExitBroken;
  }
}
