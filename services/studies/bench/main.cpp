// jostle bench: ratios measured inside one run, on this machine.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <functional>
#include <memory>
#include <optional>

#include "services/common/charts/gnuplot.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/cores.hpp"
#include "services/common/process/domain_claim.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/bench/arm_reaches.hpp"
#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/chaos.hpp"
#include "services/studies/bench/cheap_physics.hpp"
#include "services/studies/bench/coarse_grasp.hpp"
#include "services/studies/bench/estimator.hpp"
#include "services/studies/bench/first_plan.hpp"
#include "services/studies/bench/fleet_curve.hpp"
#include "services/studies/bench/idle.hpp"
#include "services/studies/bench/pool_timeline.hpp"
#include "services/studies/bench/record.hpp"
#include "services/studies/bench/tags.hpp"

namespace jostle::studies {
namespace {

constexpr const char* kSpeaker = "jostle bench";

int fail(const Error& error) {
  if (error.code == Code::kCancelled) {
    fmt::print(stderr, "{}: interrupted\n", kSpeaker);
    return common::kExitInterrupted;
  }
  fmt::print(stderr, "{}: {}\n", kSpeaker, error.message);
  return common::exit_code_of(error);
}

Result<int> exit_code(const Result<void>& ok) {
  if (!ok) return ok.error();
  return int{common::kExitOk};
}

/// What a benchmark is started with.
struct Start {
  int domain = 0;
  std::stop_token stop;
  WorkLine* line = nullptr;  ///< never null
};

/// A benchmark, its options and its results.
class Benchmark {
 public:
  enum class Uses { kNothing, kDomain };

  Benchmark(std::string its_name, std::string its_purpose, std::string it_takes, Uses what)
      : name(std::move(its_name)), purpose(std::move(its_purpose)), takes(std::move(it_takes)), uses(what) {}
  virtual ~Benchmark() = default;

  virtual void add_options(CLI::App& app) = 0;

  /// What can be told before the work begins. Error kInvalidArgument, kIo
  virtual Result<void> check() const { return check_output(json); }

  /// Returns an exit code.
  virtual Result<int> run(const Start& start) = 0;

  virtual const char* unit() const { return "runs"; }  ///< what is counted while it runs

  const std::string name, purpose;
  const std::string takes;  ///< with its defaults, on two cores; empty: it is no benchmark that a user starts
  const Uses uses;

 protected:
  void add_json(CLI::App& app) { app.add_option("--json", json, "File for all numbers"); }

  static Result<void> check_output(const std::string& file) { return common::check_outputs({{"--json", file, {}}}); }
  static Result<void> check_picture(const std::string& file) {
    if (file.empty()) return {};
    if (auto ok = common::check_picture(file); !ok) return ok;
    return common::check_outputs({{"--plot", file, {}}});
  }

  std::string json;
};

/// Two sides in turns, as most of them are.
class Ratio : public Benchmark {
 public:
  using Measure = Result<void> (*)(const Settings&);

  Ratio(std::string its_name, std::string its_purpose, std::string it_takes, Uses what, int repeats, Measure measure)
      : Benchmark(std::move(its_name), std::move(its_purpose), std::move(it_takes), what), measure_(measure) {
    settings_.repeats = repeats;
  }

  void add_options(CLI::App& app) override {
    app.add_option("--repeats", settings_.repeats, "Runs of each side, after one that is not counted")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    Measurements done;
    settings_.domain = start.domain;
    settings_.stop = start.stop;
    settings_.line = start.line;
    settings_.done = &done;
    const auto measured = measure_(settings_);
    start.line->end();
    for (const Measurement& measurement : done) fmt::print("{}", to_text(measurement));
    const bool complete = measured && !start.stop.stop_requested();
    if (!json.empty() && (complete || !done.empty())) {
      nlohmann::json results{{"results", to_json(done)}};
      if (!complete) results["partial"] = true;
      if (auto ok = common::write_results(json, std::move(results)); !ok) return ok.error();
    }
    if (start.stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
    if (!measured) return measured.error();
    return int{std::ranges::all_of(done, &Measurement::agrees) ? common::kExitOk : common::kExitFailed};
  }

 protected:
  Settings settings_;

 private:
  const Measure measure_;
};

/// The same for several numbers of workers.
class RatioOfWorkers final : public Ratio {
 public:
  using Ratio::Ratio;

  void add_options(CLI::App& app) override {
    settings_.workers = {64};
    app.add_option("--workers", settings_.workers, "Worker processes, such as 8,16,64: one measurement each")
        ->capture_default_str()
        ->delimiter(',')
        ->check(CLI::Range(1, 1024));
    Ratio::add_options(app);
  }
};

/// The same for several numbers of hosts with a worker of many threads each.
class RatioOfLanes final : public Ratio {
 public:
  using Ratio::Ratio;

  void add_options(CLI::App& app) override {
    settings_.hosts = {1, 4, 16};
    app.add_option("--hosts", settings_.hosts, "Hosts with a worker process each, such as 1,4,16: one measurement each")
        ->capture_default_str()
        ->delimiter(',')
        ->check(CLI::Range(1, 200));
    app.add_option("--lanes", settings_.lanes, "Threads of each worker")
        ->capture_default_str()
        ->check(CLI::Range(1, 1024));
    app.add_option("--steps", settings_.steps, "Control steps of the plan that assignments carry")
        ->capture_default_str()
        ->check(CLI::Range(1, 1000));
    Ratio::add_options(app);
  }
};

class Chaos final : public Benchmark {
 public:
  using Benchmark::Benchmark;

  void add_options(CLI::App& app) override {
    common::add_seed_option(app, "--seed", options_.seed, "Seed of the schedule of faults");
    app.add_option("--faults", options_.faults, "How many faults; three or so a second")
        ->capture_default_str()
        ->check(CLI::Range(1, 1'000'000));
    app.add_option("--workers", options_.workers, "Worker processes")
        ->capture_default_str()
        ->check(CLI::Range(1, 1024));
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.json = json;
    options_.domain = start.domain;
    options_.stop = start.stop;
    options_.line = start.line;
    const auto equal_result = bench_chaos(options_);
    if (!equal_result) return equal_result.error();
    return int{*equal_result ? common::kExitOk : common::kExitFailed};
  }

  const char* unit() const override { return "faults"; }

 private:
  ChaosOptions options_;
};

class CheapPhysicsBenchmark final : public Benchmark {
 public:
  using Benchmark::Benchmark;

  void add_options(CLI::App& app) override {
    app.add_option("--parts", options_.parts, "What to measure")
        ->capture_default_str()
        ->delimiter(',')
        ->check(CLI::IsMember(options_.parts));
    app.add_option("--repeats", options_.repeats, "Measurements of speed in each world")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    app.add_option("--worlds", options_.executed_worlds, "Worlds of 15 objects that are planned and executed")
        ->capture_default_str()
        ->check(CLI::Range(1, 1000));
    add_json(app);
    app.add_option("--plot", plot_, "File for a figure of cost against rollouts and time: .png, .svg or .pdf");
  }

  Result<void> check() const override {
    if (auto ok = check_picture(plot_); !ok) return ok;
    return Benchmark::check();
  }

  Result<int> run(const Start& start) override {
    options_.line = start.line;
    return exit_code(bench_cheap_physics(options_, {.json = json, .plot = plot_},
                                         common::data_file("experiments/grasping.yaml"), start.stop));
  }

 private:
  CheapPhysicsOptions options_;
  std::string plot_;
};

class FirstPlan final : public Benchmark {
 public:
  using Benchmark::Benchmark;

  void add_options(CLI::App& app) override {
    app.add_option("--worlds", options_.worlds, "Worlds, one run of each side in each")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    common::add_seed_option(app, "--seed", options_.first_seed, "Seed of the first world; the next ones follow");
    app.add_option("--objects", options_.objects, "Objects beside the target")
        ->capture_default_str()
        ->check(CLI::Range(0, 40));
    app.add_option("--table", options_.table, "Side of the table, m; 0: as dense as in Sec. 3.3.1")
        ->capture_default_str()
        ->check(CLI::Range(0.0, 10.0));
    app.add_option("--workers", options_.workers, "Threads of the pool")
        ->capture_default_str()
        ->check(CLI::Range(1, 1024));
    app.add_option("--timeout", options_.timeout, "Seconds of one run")
        ->capture_default_str()
        ->check(CLI::Range(1.0, 1e6));
    app.add_flag("--no-before{false}", options_.before, "Leave the side without guidance away");
    app.add_option("--guidance", options_.guidance, "Candidates per iteration of the side with guidance")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.line = start.line;
    return exit_code(bench_first_plan(options_, json, common::data_file("experiments/grasping.yaml"), start.stop));
  }

 private:
  FirstPlanOptions options_;
};

class Idle final : public Benchmark {
 public:
  using Benchmark::Benchmark;

  void add_options(CLI::App& app) override {
    app.add_option("--rows", options_.rows, "Only these, such as tampc-strip,mpc")
        ->delimiter(',')
        ->check(CLI::IsMember(idle_rows()));
    app.add_option("--worlds", options_.worlds, "Worlds of each row, and one run of each side in each")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    common::add_seed_option(app, "--seed", options_.first_seed, "Seed of the first world; the next ones follow");
    app.add_option("--nearness", options_.nearness, "control.plan_while_acting of the side that has it, m")
        ->capture_default_str()
        ->check(CLI::Range(1e-9, 1e3));
    app.add_option("--noise", options_.noise, "Slope b of the noise in the worlds of Ch. 5")
        ->capture_default_str()
        ->check(CLI::Range(0.0, 1.0));
    app.add_option("--rate", options_.rate, "World seconds per second while acting")
        ->capture_default_str()
        ->check(CLI::Range(0.01, 1e3));
    app.add_option("--workers", options_.workers, "Threads of the pool")
        ->capture_default_str()
        ->check(CLI::Range(1, 1024));
    app.add_option("--timeout", options_.timeout, "Seconds of one run")
        ->capture_default_str()
        ->check(CLI::Range(1.0, 1e6));
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.line = start.line;
    return exit_code(bench_idle(options_, json, start.stop));
  }

 private:
  IdleOptions options_;
};

class CoarseGrasp final : public Benchmark {
 public:
  using Benchmark::Benchmark;

  void add_options(CLI::App& app) override {
    app.add_option("--objects", options_.objects, "Objects beside the target, one row of the table each")
        ->delimiter(',')
        ->capture_default_str()
        ->check(CLI::Range(0, 40));
    app.add_option("--worlds", options_.worlds, "Worlds for each")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    app.add_option("--candidates", options_.candidates, "Candidates in each world")
        ->capture_default_str()
        ->check(CLI::Range(2, 100'000));
    common::add_seed_option(app, "--seed", options_.seed, "Seed of the first world; the next ones follow");
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.parameters = common::data_file("experiments/grasping.yaml");
    options_.json = json;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_coarse_grasp(options_));
  }

  const char* unit() const override { return "worlds"; }

 private:
  CoarseGraspOptions options_;
};

class FleetCurve final : public Benchmark {
 public:
  using Benchmark::Benchmark;

  void add_options(CLI::App& app) override {
    FleetOptions& fleet = options_.fleet;
    app.add_option("--hosts", fleet.hosts, "Hosts of the largest fleet, with a worker process each")
        ->capture_default_str()
        ->check(CLI::Range(1, 1024));
    app.add_option("--lanes", fleet.lanes, "Threads of each worker")->capture_default_str()->check(CLI::Range(1, 1024));
    app.add_option("--sample", fleet.sample, "Seconds that a sample takes")
        ->capture_default_str()
        ->check(CLI::Range(1e-4, 100.0));
    app.add_option("--samples", fleet.samples_per_lane, "Samples per lane, of one batch")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    app.add_option("--deaths", fleet.deaths_per_minute, "Share of the hosts that die in a minute")
        ->capture_default_str()
        ->check(CLI::Range(0.0, 1.0));
    app.add_option("--measured", options_.measured, "What `jostle bench lanes --json` wrote, to be simulated as well");
    common::add_seed_option(app, "--seed", fleet.seed, "Seed of latencies and deaths");
    add_json(app);
    app.add_option("--plot", plot_, "File for a picture of efficiency over lanes: .png, .svg or .pdf");
  }

  Result<void> check() const override {
    if (auto ok = check_picture(plot_); !ok) return ok;
    return Benchmark::check();
  }

  Result<int> run(const Start& start) override {
    options_.picture = plot_;
    options_.json = json;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_fleet(options_));
  }

  const char* unit() const override { return "fleets"; }

 private:
  FleetCurveOptions options_;
  std::string plot_;
};

class PoolTimeline final : public Benchmark {
 public:
  using Benchmark::Benchmark;

  void add_options(CLI::App& app) override {
    options_.workers = common::usable_cores();
    app.add_option("--workers", options_.workers, "Worker processes (default: one per core that this process may use)")
        ->check(CLI::Range(1, 1024));
    app.add_option("--clients", options_.clients, "Clients at once, each with shorter samples than the one before")
        ->capture_default_str()
        ->check(CLI::Range(1, 8));
    app.add_option("--repeats", options_.batches, "Batches of each client")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    app.add_flag("--urgent", options_.urgent, "The last client's batches are urgent");
    app.add_flag("--pin", pin_, "Give each worker a core of its own, in turn");
    app.add_option("--timeline", timeline_, "File for a picture of what each worker did when: .png, .svg or .pdf");
    add_json(app);
  }

  Result<void> check() const override {
    if (auto ok = check_picture(timeline_); !ok) return ok;
    return Benchmark::check();
  }

  Result<int> run(const Start& start) override {
    if (pin_) options_.cores = common::allowed_cores();
    options_.picture = timeline_;
    options_.json = json;
    options_.domain = start.domain;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_pool(options_));
  }

 private:
  PoolTimelineOptions options_;
  std::string timeline_;
  bool pin_ = false;
};

class Record : public Benchmark {
 public:
  using Benchmark::Benchmark;

  void add_options(CLI::App& app) override {
    add_pace(app);
    auto* disturbance =
        app.add_flag("--disturbance", disturbance_, "Measure the time of a plan with and without a recorder instead");
    app.add_option("--repeats", pairs_, "Pairs of plans of --disturbance")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000))
        ->needs(disturbance);
  }

  Result<int> run(const Start& start) override { return exit_code(bench_record(options_for(start))); }

  const char* unit() const override { return disturbance_ ? "plans" : "s"; }

 protected:
  void add_pace(CLI::App& app) {
    app.add_option("--rate", options_.rate, "Messages of 1 KiB per second")
        ->capture_default_str()
        ->check(CLI::Range(1.0, 1e6));
    app.add_option("--seconds", options_.seconds, "How long")->capture_default_str()->check(CLI::Range(0.1, 86400.0));
    add_json(app);
  }
  RecordBenchOptions options_for(const Start& start) const {
    RecordBenchOptions options = options_;
    if (disturbance_) options.pairs = pairs_;
    options.json = json;
    options.domain = start.domain;
    options.stop = start.stop;
    options.line = start.line;
    return options;
  }

 private:
  RecordBenchOptions options_;
  bool disturbance_ = false;
  int pairs_ = 9;
};

class Tags final : public Benchmark {
 public:
  using Benchmark::Benchmark;

  void add_options(CLI::App& app) override {
    app.add_option("--frames", options_.frames, "Frames of 15 tags at each of three distances")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    common::add_seed_option(app, "--seed", options_.seed, "Of the tags' poses and the images' noise");
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.json = json;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_tags(options_));
  }

  const char* unit() const override { return "frames"; }

 private:
  TagsOptions options_;
};

class ArmReachesBenchmark final : public Benchmark {
 public:
  using Benchmark::Benchmark;

  void add_options(CLI::App& app) override {
    app.add_option("--reaches", options_.reaches, "Reaches of each kind")
        ->capture_default_str()
        ->check(CLI::Range(1, 1'000'000));
    app.add_option("--speeds", options_.speeds, "Speeds of the hand, m/s")
        ->capture_default_str()
        ->delimiter(',')
        ->check(CLI::Range(0.05, 5.0));
    app.add_option("--time-steps", options_.time_steps, "Steps of the engine, s")
        ->capture_default_str()
        ->delimiter(',')
        ->check(CLI::Range(2e-4, 4e-3));
    app.add_option("--contact-times", options_.contact_times,
                   "Times in which bodies in contact part, s; at least 2 steps")
        ->capture_default_str()
        ->delimiter(',')
        ->check(CLI::Range(4e-4, 0.1));
    common::add_seed_option(app, "--seed", options_.seed, "Of the first shelf; 10 reaches in each");
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.json = json;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_arm_reaches(options_));
  }

  const char* unit() const override { return "reaches"; }

 private:
  ArmReachesOptions options_;
};

class EstimatorBenchmark final : public Benchmark {
 public:
  using Benchmark::Benchmark;

  void add_options(CLI::App& app) override {
    app.add_option("--worlds", options_.worlds, "Worlds of each kind of trouble, 20 s each")
        ->capture_default_str()
        ->check(CLI::Range(1, 100'000));
    common::add_seed_option(app, "--seed", options_.seed, "Of the worlds and of what sensors say of them");
    add_json(app);
  }

  Result<int> run(const Start& start) override {
    options_.json = json;
    options_.stop = start.stop;
    options_.line = start.line;
    return exit_code(bench_estimator(options_));
  }

  const char* unit() const override { return "worlds"; }

 private:
  EstimatorBenchOptions options_;
};

/// The other process of `record`.
class Publisher final : public Record {
 public:
  using Record::Record;
  void add_options(CLI::App& app) override { add_pace(app); }
  Result<void> check() const override { return {}; }
  Result<int> run(const Start& start) override { return publish_for_record(options_for(start)); }
};

/// The other process of `round-trip`.
class EchoServer final : public Benchmark {
 public:
  using Benchmark::Benchmark;
  void add_options(CLI::App&) override {}
  Result<int> run(const Start& start) override { return serve_echo(start.domain, start.stop); }
};

std::vector<std::unique_ptr<Benchmark>> all_benchmarks() {
  constexpr auto kNothing = Benchmark::Uses::kNothing, kDomain = Benchmark::Uses::kDomain;
  std::vector<std::unique_ptr<Benchmark>> all;
  const auto add = [&]<class Kind, class... T>(std::type_identity<Kind>, const char* name, const char* purpose,
                                               const char* takes, T... more) {
    all.push_back(std::make_unique<Kind>(name, purpose, takes, more...));
  };
  constexpr std::type_identity<Ratio> ratio;
  constexpr std::type_identity<RatioOfWorkers> of_workers;
  add(ratio, "arm-cycle", "our client of an arm's controller against a bare loop: from sample to command", "2 min",
      kDomain, 5, measure_arm_cycle);
  add(std::type_identity<ArmReachesBenchmark>(), "arm-reaches",
      "fast random reaches of an arm into shelves: what diverges, what is inside what, which torques it takes",
      "10 min", kNothing);
  add(ratio, "bag", "messages into a bag against bare appends of the same bytes", "15 s", kNothing, 7, measure_bag);
  add(std::type_identity<Chaos>(), "chaos",
      "plans while workers are killed, stalled and unplugged: all bit-equal, and how slow", "2 min", kDomain);
  add(std::type_identity<CheapPhysicsBenchmark>(), "cheap-physics",
      "freezing, screening, pruning: candidates per second, truth, success; and PBSTO's peers", "an hour", kNothing);
  add(ratio, "coarse-models", "coarse models against the fine one, per control step", "15 s", kNothing, 9,
      measure_coarse_models);
  add(ratio, "early-stop", "a batch that stops its losers against one that does not", "2 min", kNothing, 5,
      measure_early_stop);
  add(std::type_identity<CoarseGrasp>(), "coarse-grasp",
      "coarse physics of a grasp beside the engine: price, ranking, successes found", "15 min", kNothing);
  add(std::type_identity<EstimatorBenchmark>(), "estimator",
      "the estimate of objects against the last measurement: error, lag, overlaps, under every trouble", "1 min",
      kNothing);
  add(std::type_identity<FirstPlan>(), "first-plan",
      "first plans and re-plans of grasps in fresh worlds, without and with guidance", "an hour", kNothing);
  add(std::type_identity<FleetCurve>(), "fleet",
      "simulated: efficiency from one lane to thousands on many hosts, some of which die", "2 min", kNothing);
  add(ratio, "hosts", "between two hosts: round trip and throughput, protected against unprotected", "5 min", kDomain,
      9, measure_hosts);
  add(of_workers, "hosts-scheduling", "waiting workers on several hosts against workers that never idle", "1 min",
      kDomain, 5, measure_hosts_scheduling);
  add(std::type_identity<Idle>(), "idle",
      "how long robots stand still before their actions, with plans made meanwhile and while they act", "an hour",
      kNothing);
  add(std::type_identity<RatioOfLanes>(), "lanes",
      "waiting threads of one worker per host against threads that never idle", "1 min", kDomain, 5, measure_lanes);
  add(ratio, "parareal", "Parareal on all processors against what Eq. 6.4 allows", "15 s", kNothing, 15,
      measure_parareal);
  add(ratio, "parareal-scheduling", "Parareal on 4 to 32 waiting workers against Eq. 6.4", "1 min", kDomain, 9,
      measure_parareal_scheduling);
  add(ratio, "play", "a bag as a subscriber hears it against the bag, at rates from 0.1 to 10", "5 min", kDomain, 3,
      measure_play);
  add(std::type_identity<PoolTimeline>(), "pool", "what each worker did when: busy shares, gaps, a picture", "10 s",
      kDomain);
  add(ratio, "pool-dds", "two worker processes against two bare loops", "15 s", kDomain, 15, measure_pool_dds);
  add(ratio, "pool-threads", "ThreadPool against bare loops of engine steps", "15 s", kNothing, 15,
      measure_pool_threads);
  add(std::type_identity<Record>(), "record", "the recorder at 20,000 messages per second, or what it costs a plan",
      "75 s", kDomain);
  add(ratio, "robust-iteration", "an iteration of RobustSTO on waiting threads against one rollout (Eq. 4.43)", "2 min",
      kNothing, 7, measure_robust_iteration);
  add(ratio, "round-trip", "an empty assignment through the pool against a bare Fast DDS echo", "2 s", kDomain, 25,
      measure_round_trip);
  add(of_workers, "scheduling", "waiting workers against workers that never idle", "30 s", kDomain, 5,
      measure_scheduling);
  add(std::type_identity<Tags>(), "tags",
      "poses of tags in rendered images: errors, flips, honest covariances, time beside libapriltag's defaults",
      "1 min", kNothing);
  add(ratio, "unplugged", "work one of whose two hosts is unplugged for a while against work left alone", "7 min",
      kDomain, 5, measure_unplugged);
  add(std::type_identity<EchoServer>(), "echo", "", "", kDomain);
  add(std::type_identity<Publisher>(), "publish", "", "", kDomain);
  return all;
}

int list(const std::vector<std::unique_ptr<Benchmark>>& benchmarks) {
  for (const auto& benchmark : benchmarks) {
    if (!benchmark->takes.empty())
      fmt::print("{:<20} {} (about {})\n", benchmark->name, benchmark->purpose, benchmark->takes);
  }
  return common::kExitOk;
}

int run(Benchmark& benchmark, std::optional<int> domain) {
  if (auto ok = benchmark.check(); !ok) return fail(ok.error());
  // Neither a user's system nor another benchmark is in the way.
  std::optional<common::OwnDomain> own;
  if (!domain && benchmark.uses == Benchmark::Uses::kDomain) {
    auto own_result = common::claim_some_domain();
    if (!own_result) return fail(own_result.error());
    own = std::move(own_result).value();
    domain = own->domain;
  }
  const common::StopSignal signal;
  WorkLine line(fmt::format("{} {}", kSpeaker, benchmark.name), benchmark.unit());
  try {
    const auto code_result = benchmark.run({.domain = domain.value_or(0), .stop = signal.token(), .line = &line});
    line.end();
    return code_result ? *code_result : fail(code_result.error());
  } catch (const std::exception& error) {  // the middleware's SetupError, the engine's errors
    line.end();
    fmt::print(stderr, "{}: {}\n", kSpeaker, error.what());
    return common::kExitBroken;
  }
}

}  // namespace
}  // namespace jostle::studies

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::studies;
  CLI::App app(
      "Measures the ratio of two ways to do the same work, in turns, on this machine. `jostle bench NAME --help`\n"
      "lists the options of a benchmark.",
      kSpeaker);
  app.require_subcommand(0, 1);
  std::string unknown;
  std::optional<int> domain;
  const auto benchmarks = all_benchmarks();
  for (const auto& benchmark : benchmarks) {
    const bool is_public = !benchmark->takes.empty();
    CLI::App* command = app.add_subcommand(
        benchmark->name, is_public ? fmt::format("{} (about {})", benchmark->purpose, benchmark->takes) : "");
    if (!is_public) command->group("");
    benchmark->add_options(*command);
    if (benchmark->uses == Benchmark::Uses::kDomain) {
      common::add_network_options(*command);
      command->add_option("--domain", domain, "DDS domain (default: one of its own, 1 to 100)")
          ->check(CLI::Range(0, 232));
    }
    command->footer(
        "Exit codes: 0 measured, 1 the two sides computed different things, 2 bad arguments,\n"
        "3 a part of the system failed, 130 interrupted: what was measured is printed. Slowness is no failure.");
  }
  const CLI::App* lists = app.add_subcommand("list", "list the benchmarks, and how long each takes");
  app.add_option("name", unknown)->group("");  // what is no benchmark ends up here
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;

  if (lists->parsed()) return list(benchmarks);
  for (const auto& benchmark : benchmarks) {
    if (app.get_subcommand(benchmark->name)->parsed()) return run(*benchmark, domain);
  }
  if (unknown.empty()) unknown = "nothing";
  fmt::print(stderr, "{}: name: got '{}', wanted one that `jostle bench list` shows\n", kSpeaker, unknown);
  return common::kExitUsage;
}
