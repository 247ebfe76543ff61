// jostle coordinator: plans and executes the tasks it is given.

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>

#include "physics_pool/local/thread_pool.hpp"
#include "services/coordinator/coordinator.hpp"
#include "services/pool_remote/remote_pool.hpp"
#include "services/support/cores.hpp"
#include "services/support/program.hpp"

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::services;
  CLI::App app("Accepts a task, plans it with a pool of workers, executes it and reports.", "jostle coordinator");
  std::string pool_kind = "dds";
  int threads = usable_cores();
  dds::ParticipantOptions participant_options{.name = "jostle_coordinator"};
  ProcessOptions process;
  app.add_option("--pool", pool_kind, "dds: worker processes; threads: in this process")
      ->capture_default_str()
      ->check(CLI::IsMember({"dds", "threads"}));
  add_count_option(app, "--threads", threads, 1, "Of the pool of threads; auto: one per core this process may use")
      ->default_str("auto");
  add_process_options(app, process);
  if (const auto code = parse_arguments(app, argc, argv)) return *code;
  die_with_parent(process.parent);
  participant_options.domain = process.domain;
  const StopSignal signal;
  set_up_logging("coordinator");

  auto participant_result = dds::Participant::open(participant_options);
  if (!participant_result) {
    spdlog::error("{}", participant_result.error().message);
    return kExitUsage;
  }
  spdlog::info("{}, domain {}", participant_name(participant_result->id()), participant_result->domain());
  try {
    std::unique_ptr<physics_pool::AsyncPool> pool;
    if (pool_kind == "dds") {
      pool = std::make_unique<RemotePool>(*participant_result);
    } else {
      pool = std::make_unique<physics_pool::ThreadPool>(threads);
    }
    Coordinator(*participant_result, *pool).run(signal.token());
    return kExitOk;
  } catch (const dds::SetupError& error) {
    spdlog::error("{}", error.what());
    return kExitBroken;
  }
}
