// jostle coordinator: plans and executes the tasks it is given.

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <chrono>

#include "physics_pool/local/thread_pool.hpp"
#include "services/common/process/cores.hpp"
#include "services/common/process/domain_claim.hpp"
#include "services/common/process/program.hpp"
#include "services/pool/client/remote_pool.hpp"
#include "services/task/coordinator/coordinator.hpp"

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::task;
  CLI::App app("Accepts a task, plans it with a pool of workers, executes it and reports.", "jostle coordinator");
  std::string pool_kind = "dds";
  int threads = common::usable_cores();
  wire::ParticipantOptions participant_options{
      .name = "jostle_coordinator", .role = wire::Role::kRobot, .waits_for_server = true};
  common::ProcessOptions process;
  app.add_option("--pool", pool_kind, "dds: worker processes; threads: in this process")
      ->capture_default_str()
      ->check(CLI::IsMember({"dds", "threads"}));
  common::add_count_option(app, "--threads", threads, 1,
                           "Of the pool of threads; auto: one per core this process may use")
      ->default_str("auto");
  common::add_process_options(app, process);
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  common::die_with_parent(process.parent);
  participant_options.domain = process.domain;
  const common::StopSignal signal;
  common::set_up_logging("coordinator");

  auto participant_result = wire::Participant::open(participant_options);
  if (!participant_result) {
    spdlog::error("{}", participant_result.error().message);
    return common::exit_code_of(participant_result.error());
  }
  // Two coordinators would both take every goal, and command one robot.
  const auto claim_result = common::DomainClaim::take("coordinator", participant_result->domain(),
                                                      std::chrono::seconds(1), participant_result->space());
  if (!claim_result) {
    spdlog::error("{}", claim_result.error().message);
    return common::exit_code_of(claim_result.error());
  }
  spdlog::info("{}, domain {}", common::participant_name(participant_result->id()), participant_result->domain());
  try {
    TroubleBoard troubles;
    const auto on_trouble = [&](const std::string& text) {
      if (!text.empty()) spdlog::warn("{}", text);
      troubles.post(text);
    };
    std::unique_ptr<physics_pool::AsyncPool> pool;
    if (pool_kind == "dds") {
      pool = std::make_unique<pool::RemotePool>(*participant_result, pool::RemotePoolOptions{.on_trouble = on_trouble});
    } else {
      pool = std::make_unique<physics_pool::ThreadPool>(threads);
    }
    Coordinator(*participant_result, *pool, troubles).run(signal.token());
    return common::kExitOk;
  } catch (const wire::SetupError& error) {
    spdlog::error("{}", error.what());
    return common::kExitBroken;
  }
}
