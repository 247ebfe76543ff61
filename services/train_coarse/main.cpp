// jostle train-coarse: the learned coarse model of Sec. 7.2, from pushes to weights.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <thread>

#include "physics_pool/local/thread_pool.hpp"
#include "services/pool_remote/remote_pool.hpp"
#include "services/support/program.hpp"
#include "services/train_coarse/collect.hpp"
#include "services/train_coarse/episode.hpp"
#include "services/train_coarse/progress.hpp"

namespace jostle::services {
namespace {

struct Arguments {
  ProcessOptions process;
  std::string data, net;
  // data
  CollectOptions collect;
  std::string pool = "threads";
  int threads = static_cast<int>(std::max(std::thread::hardware_concurrency(), 1u));
};

int fail(const Error& error) {
  fmt::print(stderr, "jostle train-coarse: {}\n", error.message);
  switch (error.code) {
    case Code::kCancelled: return kExitInterrupted;
    case Code::kInvalidArgument:
    case Code::kNotFound: return kExitUsage;
    case Code::kUnavailable:
    case Code::kInternal: return kExitBroken;
    default: return kExitFailed;
  }
}

int collect_from(physics_pool::Pool& pool, const Arguments& arguments, std::stop_token stop) {
  ProgressLine line("transitions");
  const auto result = collect(pool, arguments.data, arguments.collect, stop, [&line](const CollectProgress& progress) {
    line.show(progress.found, progress.done, progress.samples);
  });
  return result ? kExitOk : fail(result.error());
}

int collect_data(Arguments& arguments, std::stop_token stop) {
  if (arguments.pool == "threads") {
    arguments.collect.in_flight = arguments.threads;
    physics_pool::ThreadPool pool(arguments.threads);
    return collect_from(pool, arguments, stop);
  }
  // Enough to keep the queues of a few machines full.
  arguments.collect.in_flight = 64;
  auto participant_result = dds::Participant::open({.name = "jostle_train_coarse", .domain = arguments.process.domain});
  if (!participant_result) return fail(participant_result.error());
  try {
    RemotePool pool(*participant_result);
    return collect_from(pool, arguments, stop);
  } catch (const dds::SetupError& error) {
    return fail({Code::kInternal, error.what()});
  }
}

using Command = int (*)(Arguments&, std::stop_token);

void add_commands(CLI::App& app, Arguments& arguments, Command& chosen) {
  const auto command = [&](const char* name, const char* purpose, Command work) {
    CLI::App* added = app.add_subcommand(name, purpose);
    added->callback([&chosen, work] { chosen = work; });
    return added;
  };
  CLI::App* data = command("data", "push cylinders about and note what happens", collect_data);
  data->add_option("--out", arguments.data, "File of transitions; one that exists is continued")->required();
  data->add_option("--samples", arguments.collect.samples, "Transitions the file is to have")
      ->capture_default_str()->check(CLI::Range(1u, 4'000'000'000u));
  data->add_option("--seed", arguments.collect.origin.seed, "Equal seeds give equal files")
      ->capture_default_str()->check(CLI::Range(0u, 4'000'000'000u));
  data->add_option("--pool", arguments.pool, "threads: in this process; dds: worker processes")
      ->capture_default_str()->check(CLI::IsMember({"dds", "threads"}));
  data->add_option("--threads", arguments.threads, "Of the pool of threads")
      ->capture_default_str()->check(CLI::Range(1, 1024));
  add_process_options(*data, arguments.process);
}

}  // namespace
}  // namespace jostle::services

int main(int argc, char** argv) {
  using namespace jostle::services;
  Arguments arguments;
  Command chosen = nullptr;
  CLI::App app{"Trains the learned coarse model: collects pushes, fits a network to them, checks it.",
               "jostle train-coarse"};
  app.require_subcommand(1);
  add_commands(app, arguments, chosen);
  if (const auto code = parse_arguments(app, argc, argv)) return *code;
  die_with_parent(arguments.process.parent);
  const StopSignal signal;
  set_up_logging("train-coarse");
  return chosen(arguments, signal.token());
}
