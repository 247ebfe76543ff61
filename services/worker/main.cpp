/// \file
/// jostle_worker: lends this machine's cores to the rollout pool.

#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>

#include "services/pool_remote/worker_service.hpp"

namespace {

using namespace jostle;

// Blocked before any thread starts, so that all of them inherit it and only
// sigwait() sees these signals.
sigset_t block_end_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  return signals;
}

// False when the parent was gone before it could be asked to take us along.
bool die_with_parent() {
  const pid_t parent = getppid();
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  return getppid() == parent && parent != 1;
}

int serve(const dds::ParticipantOptions& dds_options, const services::WorkerOptions& options,
          const sigset_t& end_signals) {
  auto participant_result = dds::Participant::open(dds_options);
  if (!participant_result) {
    fmt::print(stderr, "jostle worker: {}\n", participant_result.error().message);
    return 1;
  }
  services::WorkerService worker(*participant_result, options);
  fmt::print(stderr, "worker {}: {} threads, domain {}\n", worker.name(), options.threads,
             participant_result->domain());
  int signal = 0;
  sigwait(&end_signals, &signal);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"Runs rollouts for any planner in the same DDS domain until it is told to end."};
  services::WorkerOptions options;
  dds::ParticipantOptions dds_options{.name = "jostle_worker"};
  bool with_parent = false;
  app.add_option("--threads", options.threads, "rollouts at a time")
      ->capture_default_str()->check(CLI::Range(1, 1024));
  app.add_option("--domain", dds_options.domain, "DDS domain; default ROS_DOMAIN_ID, else 0")
      ->check(CLI::Range(0, 232));
  app.add_option("--name", options.name, "as clients report it; default host and process id");
  app.add_flag("--die-with-parent", with_parent, "end when the starting process does");
  CLI11_PARSE(app, argc, argv);

  const sigset_t end_signals = block_end_signals();
  if (with_parent && !die_with_parent()) return 0;
  try {
    return serve(dds_options, options, end_signals);
  } catch (const dds::SetupError& error) {
    fmt::print(stderr, "jostle worker: {}\n", error.what());
    return 1;
  }
}
