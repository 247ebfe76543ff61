// jostle bench: ratios measured inside one run, on this machine.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <optional>

#include "services/common/process/cores.hpp"
#include "services/common/process/domain_claim.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/chaos.hpp"
#include "services/studies/bench/cheap_physics.hpp"
#include "services/studies/bench/pool_timeline.hpp"
#include "services/studies/bench/record.hpp"

namespace jostle::studies {
namespace {

struct Benchmark {
  const char* name;
  const char* purpose;
  int repeats;  // unless the user says
  Result<Measurements> (*measure)(const Settings&);
};

constexpr auto kBenchmarks = std::to_array<Benchmark>({
    {"bag", "messages into a bag against bare appends of the same bytes", 7, measure_bag},
    {"play", "a bag as a subscriber hears it against the bag, at rates from 0.1 to 10", 3, measure_play},
    {"pool-threads", "ThreadPool against bare loops of engine steps", 15, measure_pool_threads},
    {"pool-dds", "two worker processes against two bare loops", 15, measure_pool_dds},
    {"round-trip", "an empty assignment through the pool against a bare Fast DDS echo", 25, measure_round_trip},
    {"early-stop", "a batch that stops its losers against one that does not", 5, measure_early_stop},
    {"scheduling", "waiting workers against workers that never idle", 5, measure_scheduling},
    {"coarse-models", "coarse models against the fine one, per control step", 9, measure_coarse_models},
    {"parareal", "Parareal on all processors against what Eq. 6.4 allows", 15, measure_parareal},
    {"parareal-scheduling", "Parareal on 4 to 32 waiting workers against Eq. 6.4", 9, measure_parareal_scheduling},
    {"hosts", "between two hosts: round trip and throughput, protected against unprotected", 9, measure_hosts},
    {"hosts-scheduling", "waiting workers on several hosts against workers that never idle", 5,
     measure_hosts_scheduling},
    {"unplugged", "work one of whose two hosts is unplugged for a while against work left alone", 5, measure_unplugged},
});

constexpr const char* kChaos = "chaos";
constexpr const char* kCheapPhysics = "cheap-physics";
constexpr const char* kPool = "pool";
constexpr const char* kRecord = "record";

int list() {
  fmt::print("{:<20} {}\n", kChaos,
             "plans while workers are killed, stalled and unplugged: all bit-equal, and how slow");
  fmt::print("{:<20} {}\n", kCheapPhysics,
             "freezing, screening, pruning: candidates per second, truth, success; and PBSTO's peers");
  fmt::print("{:<20} {}\n", kPool, "what each worker did when: busy shares, gaps, a picture");
  fmt::print("{:<20} {}\n", kRecord, "the recorder at 20,000 messages per second, or what it costs a plan");
  for (const Benchmark& benchmark : kBenchmarks) fmt::print("{:<20} {}\n", benchmark.name, benchmark.purpose);
  return common::kExitOk;
}

int fail(const Error& error, int code) {
  fmt::print(stderr, "jostle bench: {}\n", error.message);
  return error.code == Code::kCancelled ? common::kExitInterrupted : code;
}

int perform(const Benchmark& benchmark, Settings settings, const std::string& json) {
  if (settings.repeats == 0) settings.repeats = benchmark.repeats;
  auto result = benchmark.measure(settings);
  if (!result) return fail(result.error(), common::kExitBroken);
  for (const Measurement& measurement : *result) fmt::print("{}", to_text(measurement));
  if (!json.empty()) {
    if (auto ok = common::write_results(json, to_json(*result)); !ok) return fail(ok.error(), common::kExitBroken);
  }
  const bool agree = std::ranges::all_of(*result, &Measurement::agrees);
  return agree ? common::kExitOk : common::kExitFailed;
}

int compare_levers(const Settings& settings, const std::string& json, const std::string& plot, int worlds,
                   const std::vector<std::string>& parts) {
  CheapPhysicsOptions options{.parts = parts, .executed_worlds = worlds, .on_news = [](const std::string& line) {
                                fmt::print(stderr, "{}\n", line);
                              }};
  if (settings.repeats > 0) options.repeats = settings.repeats;
  const auto ok = bench_cheap_physics(options, {.json = json, .plot = plot},
                                      common::data_file("experiments/grasping.yaml"), settings.stop);
  return ok ? common::kExitOk : fail(ok.error(), common::kExitBroken);
}

std::optional<Error> not_one_number(const std::vector<int>& workers) {
  if (workers.size() < 2) return {};
  return Error{Code::kInvalidArgument, fmt::format("--workers: got {} numbers, wanted one", workers.size())};
}

int disturb(const Settings& settings, ChaosOptions options) {
  if (const auto problem = not_one_number(settings.workers)) return fail(*problem, common::kExitUsage);
  if (!settings.workers.empty()) options.workers = settings.workers.front();
  options.domain = settings.domain;
  options.on_news = settings.on_news;
  options.stop = settings.stop;
  const auto equal_result = bench_chaos(options);
  if (!equal_result) return fail(equal_result.error(), common::kExitBroken);
  return *equal_result ? common::kExitOk : common::kExitFailed;
}

int show_pool(const Settings& settings, PoolTimelineOptions options) {
  if (const auto problem = not_one_number(settings.workers)) return fail(*problem, common::kExitUsage);
  options.workers = settings.workers.empty() ? common::usable_cores() : settings.workers.front();
  if (settings.repeats > 0) options.batches = settings.repeats;
  options.domain = settings.domain;
  options.stop = settings.stop;
  const auto ok = bench_pool(options);
  return ok ? common::kExitOk
            : fail(ok.error(), ok.error().code == Code::kInvalidArgument ? common::kExitUsage : common::kExitBroken);
}

int record(const Settings& settings, RecordBenchOptions options, bool disturbance) {
  if (disturbance) options.pairs = settings.repeats > 0 ? settings.repeats : 9;
  const auto ok = bench_record(options);
  return ok ? common::kExitOk : fail(ok.error(), common::kExitBroken);
}

int start(const std::string& name, const Settings& settings, const std::string& json) {
  if (name == "list") return list();
  if (name == "echo") return serve_echo(settings.domain, settings.stop);
  const auto benchmark = std::ranges::find(kBenchmarks, name, [](const Benchmark& b) { return std::string(b.name); });
  if (benchmark == kBenchmarks.end()) {
    return fail(
        {Code::kInvalidArgument, fmt::format("name: got '{}', wanted one that `jostle bench list` shows", name)},
        common::kExitUsage);
  }
  return perform(*benchmark, settings, json);
}

}  // namespace
}  // namespace jostle::studies

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::studies;
  CLI::App app("Measures the ratio of two ways to do the same work, in turns, on this machine.", "jostle bench");
  std::string name, json, plot;
  int worlds = CheapPhysicsOptions{}.executed_worlds;
  std::vector<std::string> parts = CheapPhysicsOptions{}.parts;
  Settings settings{.on_news = [](const std::string& line) { fmt::print(stderr, "{}\n", line); }};
  app.add_option("name", name, "A benchmark, or `list`")->required();
  app.add_option("--repeats", settings.repeats, "Runs of each side, batches of pool (default: the benchmark's)")
      ->check(CLI::Range(1, 100'000));
  app.add_option("--json", json, "File for all numbers");
  app.add_option("--plot", plot, "Of cheap-physics: PNG of cost against rollouts and against time");
  app.add_option("--parts", parts, "Of cheap-physics: what to measure")
      ->capture_default_str()
      ->delimiter(',')
      ->check(CLI::IsMember(parts));
  app.add_option("--worlds", worlds, "Of cheap-physics: worlds of 15 objects that are planned and executed")
      ->capture_default_str()
      ->check(CLI::Range(1, 1000));
  app.add_option("--workers", settings.workers,
                 "Of scheduling, hosts-scheduling: worker processes, such as 8,16,64 (default: 64);\n"
                 "of pool: their number (default: one per core this process may use); of chaos: theirs (default: 4)")
      ->delimiter(',')
      ->check(CLI::Range(1, 1024));
  ChaosOptions chaos;
  app.add_option("--seed", chaos.seed, "Of chaos: of its schedule")->capture_default_str();
  app.add_option("--faults", chaos.faults, "Of chaos: how many")
      ->capture_default_str()
      ->check(CLI::Range(1, 1'000'000));
  PoolTimelineOptions timeline;
  bool pin = false;
  app.add_option("--timeline", timeline.picture, "Of pool: PNG or SVG of what each worker did when");
  app.add_option("--clients", timeline.clients,
                 "Of pool: clients at once, each with shorter samples than the one before")
      ->capture_default_str()
      ->check(CLI::Range(1, 8));
  app.add_flag("--urgent", timeline.urgent, "Of pool: the last client's batches are urgent");
  app.add_flag("--pin", pin, "Of pool: give each worker a core of its own, in turn");
  RecordBenchOptions recording;
  bool disturbance = false;
  app.add_option("--rate", recording.rate, "Of record: messages of 1 KiB per second")
      ->capture_default_str()
      ->check(CLI::Range(1.0, 1e6));
  app.add_option("--seconds", recording.seconds, "Of record: how long")
      ->capture_default_str()
      ->check(CLI::Range(0.1, 86400.0));
  app.add_flag("--disturbance", disturbance, "Of record: the time of a plan with and without a recorder instead");
  common::add_network_options(app);
  auto* domain = app.add_option("--domain", settings.domain, "DDS domain (default: one of its own, 1 to 100)")
                     ->check(CLI::Range(0, 232));
  app.footer(
      "Exit codes: 0 measured, 1 the two sides computed different things, 2 bad arguments,\n"
      "3 a part of the system failed, 130 interrupted. Slowness is no failure.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  // Neither a user's system nor another benchmark is in the way.
  std::optional<common::OwnDomain> own;
  if (domain->count() == 0) {
    auto own_result = common::claim_some_domain();
    if (!own_result) return fail(own_result.error(), common::kExitBroken);
    own = std::move(own_result).value();
    settings.domain = own->domain;
  }
  const common::StopSignal signal;
  settings.stop = signal.token();
  try {
    if (name == kChaos) {
      chaos.json = json;
      return disturb(settings, chaos);
    }
    if (app.count("--seed") + app.count("--faults") > 0) {
      fmt::print(stderr, "jostle bench: --seed, --faults: got '{}', wanted {}\n", name, kChaos);
      return common::kExitUsage;
    }
    if (name == kCheapPhysics) return compare_levers(settings, json, plot, worlds, parts);
    if (name == kPool) {
      timeline.json = json;
      if (pin) timeline.cores = common::allowed_cores();
      return show_pool(settings, timeline);
    }
    recording.json = json;
    recording.domain = settings.domain;
    recording.stop = settings.stop;
    if (name == kRecord) return record(settings, recording, disturbance);
    if (name == "publish") return publish_for_record(recording);
    if (app.count("--rate") + app.count("--seconds") + app.count("--disturbance") > 0) {
      fmt::print(stderr, "jostle bench: --rate, --seconds, --disturbance: got '{}', wanted {}\n", name, kRecord);
      return common::kExitUsage;
    }
    if (app.count("--timeline") + app.count("--clients") + app.count("--urgent") + app.count("--pin") > 0) {
      fmt::print(stderr, "jostle bench: --timeline, --clients, --urgent, --pin: got '{}', wanted {}\n", name, kPool);
      return common::kExitUsage;
    }
    if (settings.workers.empty()) settings.workers = {64};
    if (app.count("--plot") + app.count("--worlds") + app.count("--parts") > 0) {
      fmt::print(stderr, "jostle bench: --plot, --worlds, --parts: got '{}', wanted {}\n", name, kCheapPhysics);
      return common::kExitUsage;
    }
    return start(name, settings, json);
  } catch (const std::exception& error) {  // the middleware's SetupError, the engine's errors
    fmt::print(stderr, "jostle bench: {}\n", error.what());
    return common::kExitBroken;
  }
}
