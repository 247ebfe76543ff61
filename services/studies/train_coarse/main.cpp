// jostle train-coarse: the learned coarse model of Sec. 7.2, from pushes to weights.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <thread>

#include "physics_pool/local/thread_pool.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/common/results/results.hpp"
#include "services/common/terminal/progress_line.hpp"
#include "services/pool/client/remote_pool.hpp"
#include "services/studies/train_coarse/collect.hpp"
#include "services/studies/train_coarse/examples.hpp"
#include "services/studies/train_coarse/fit.hpp"

namespace jostle::studies {
namespace {

struct Arguments {
  common::ProcessOptions process;
  std::string data, net;
  // data
  CollectOptions collect;
  std::string pool = "threads";
  int threads = static_cast<int>(std::max(std::thread::hardware_concurrency(), 1u));
  // fit
  FitOptions fit;
  bool everything = false;
};

int fail(const Error& error) {
  fmt::print(stderr, "jostle train-coarse: {}\n", error.message);
  return common::exit_code_of(error);
}

int collect_from(physics_pool::Pool& pool, const Arguments& arguments, std::stop_token stop) {
  const auto result = [&] {  // the line ends before an error is told
    common::ProgressLine line({.doing = "collecting", .unit = "transitions", .plain = common::PlainLines::kElsewhere});
    return collect(pool, arguments.data, arguments.collect, stop, [&line](const CollectProgress& progress) {
      line.show(progress.done, progress.samples, progress.found);
    });
  }();
  return result ? common::kExitOk : fail(result.error());
}

int collect_data(Arguments& arguments, std::stop_token stop) {
  if (auto ok = common::check_outputs({{"--out", arguments.data, {}}}); !ok) return fail(ok.error());
  if (arguments.pool == "threads") {
    arguments.collect.in_flight = arguments.threads;
    physics_pool::ThreadPool pool(arguments.threads);
    return collect_from(pool, arguments, stop);
  }
  // Enough to keep the queues of a few machines full.
  arguments.collect.in_flight = 64;
  auto participant_result = wire::Participant::open(
      {.name = "jostle_train_coarse", .domain = arguments.process.domain, .role = wire::Role::kRobot});
  if (!participant_result) return fail(participant_result.error());
  try {
    pool::RemotePool pool(*participant_result);
    return collect_from(pool, arguments, stop);
  } catch (const wire::SetupError& error) {
    return fail({Code::kInternal, error.what()});
  }
}

int fit_network(Arguments& arguments, std::stop_token stop) {
  if (auto ok = common::check_outputs({{"--out", arguments.net, {}}}); !ok) return fail(ok.error());
  const auto start = std::chrono::steady_clock::now();
  const auto data_result = read_transitions(arguments.data);
  if (!data_result) return fail(data_result.error());
  const auto network_result = fit(*data_result, arguments.fit, stop, [&](const FitProgress& progress) {
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const double left = seconds / progress.epoch * (arguments.fit.epochs - progress.epoch);
    fmt::print(stderr, "epoch {:>3} of {}: loss {:.5f}, held out {:.5f}, {:.1f} s each, {} left\n", progress.epoch,
               arguments.fit.epochs, progress.loss, progress.held_out_loss, seconds / progress.epoch,
               common::duration_text(left));
  });
  if (!network_result) return fail(network_result.error());
  if (auto ok = common::write_text(arguments.net, to_file(*network_result)); !ok) return fail(ok.error());
  fmt::print("{}: {} transitions, errors of those held out:\n{}", arguments.net, network_result->samples,
             accuracy_table(accuracy_of(*network_result, *data_result, Part::kHeldOut, arguments.fit.held_out)));
  return stop.stop_requested() ? common::kExitInterrupted : common::kExitOk;
}

constexpr double kSame = 1e-5;  // m, rad and shares: float32 sums in another order

int check_network(Arguments& arguments, std::stop_token) {
  const auto network_result = physics_pool::load_network(arguments.net);
  if (!network_result) return fail(network_result.error());
  const auto data_result = read_transitions(arguments.data);
  if (!data_result) return fail(data_result.error());
  const Part part = arguments.everything ? Part::kAll : Part::kHeldOut;
  fmt::print("{}", accuracy_table(accuracy_of(*network_result, *data_result, part, arguments.fit.held_out)));
  if (!can_fit()) {
    fmt::print("built without libtorch: forward passes not compared\n");
    return common::kExitOk;
  }
  const auto difference_result = largest_difference(*network_result, *data_result);
  if (!difference_result) return fail(difference_result.error());
  const bool is_same = *difference_result <= kSame;
  fmt::print("largest difference to libtorch's forward pass {:.1e}, {} {:.0e}\n", *difference_result,
             is_same ? "within" : "NOT within", kSame);
  return is_same ? common::kExitOk : common::kExitFailed;
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
      ->capture_default_str()
      ->check(CLI::Range(1u, 4'000'000'000u));
  common::add_seed_option(*data, "--seed", arguments.collect.origin.seed, "Equal seeds give equal files")
      ->check(CLI::Range(0u, 4'000'000'000u));
  data->add_option("--pool", arguments.pool, "threads: in this process; dds: worker processes")
      ->capture_default_str()
      ->check(CLI::IsMember({"dds", "threads"}));
  data->add_option("--threads", arguments.threads, "Of the pool of threads")
      ->capture_default_str()
      ->check(CLI::Range(1, 1024));
  common::add_process_options(*data, arguments.process);

  const auto add_held_out = [&arguments](CLI::App& to) {
    to.add_option("--held-out", arguments.fit.held_out, "Share of the episodes for validation only")
        ->capture_default_str()
        ->check(CLI::Range(0.001, 0.5));
  };
  CLI::App* fits = command("fit", "fit the network to transitions and say how well it predicts", fit_network);
  fits->add_option("--data", arguments.data, "File of transitions")->required();
  fits->add_option("--out", arguments.net, "File of the network")->required();
  fits->add_option("--epochs", arguments.fit.epochs, "Passes over the data; Ctrl-C keeps the best so far")
      ->capture_default_str()
      ->check(CLI::Range(1, 100'000));
  fits->add_option("--batch-size", arguments.fit.batch_size, "Transitions per step")
      ->capture_default_str()
      ->check(CLI::Range(1, 1'000'000));
  fits->add_option("--learning-rate", arguments.fit.learning_rate, "Of Adam, at first")
      ->capture_default_str()
      ->check(CLI::Range(1e-8, 1.0));
  fits->add_option("--no-penetration-weight", arguments.fit.no_penetration_weight, "W_F of Eq. 7.5")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1e6));
  common::add_seed_option(*fits, "--seed", arguments.fit.seed, "Of the first weights and the order of the data");
  fits->add_option("--threads", arguments.fit.threads, "Of libtorch")
      ->capture_default_str()
      ->check(CLI::Range(1, 1024));
  add_held_out(*fits);

  CLI::App* checks =
      command("check", "say how well a network predicts, and compare its forward pass with libtorch's", check_network);
  checks->add_option("--net", arguments.net, "File of the network")->required();
  checks->add_option("--data", arguments.data, "File of transitions")->required();
  checks->add_flag("--all", arguments.everything, "Errors of all transitions, not of those that fit holds out");
  add_held_out(*checks);
}

}  // namespace
}  // namespace jostle::studies

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::studies;
  Arguments arguments;
  Command chosen = nullptr;
  CLI::App app{"Trains the learned coarse model: collects pushes, fits a network to them, checks it.",
               "jostle train-coarse"};
  app.require_subcommand(1);
  add_commands(app, arguments, chosen);
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  common::die_with_parent(arguments.process.parent);
  const common::StopSignal signal;
  common::set_up_logging("train-coarse");
  return chosen(arguments, signal.token());
}
