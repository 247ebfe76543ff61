#include "services/studies/bench/chaos.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <condition_variable>
#include <csignal>
#include <cstdlib>
#include <map>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <thread>
#include <vector>

#include "services/common/charts/statistics.hpp"
#include "services/common/lab/hosts.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/program.hpp"
#include "services/common/results/results.hpp"
#include "services/studies/bench/catalogue.hpp"
#include "services/studies/bench/chaos_schedule.hpp"
#include "services/studies/bench/plan_again.hpp"
#include "services/studies/bench/swarm.hpp"
#include "services/studies/bench/workload.hpp"

namespace jostle::studies {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kWorkerHosts = 2;
constexpr int kFirstWorkerHost = 2;
constexpr int kIterations = 4;   // of a plan: a second or two
constexpr int kUndisturbed = 3;  // plans before the first fault
constexpr std::chrono::seconds kPlanPatience{120};
constexpr std::chrono::seconds kHang{20};    // beyond a deadline that should have ended it
constexpr std::chrono::seconds kReturn{30};  // of all workers, after the last fault

// Carries out a schedule, on a thread of its own.
class Saboteur {
 public:
  Saboteur(std::vector<Fault> schedule, Helpers& helpers, const common::Hosts* hosts)
      : schedule_(std::move(schedule)),
        helpers_(helpers),
        hosts_(hosts),
        thread_([this](std::stop_token stop) { work(stop); }) {}

  bool done() const { return done_; }

  int faults() const { return faults_; }

  // The newest fault, for a message.
  std::string where() const {
    const int count = faults_;
    if (count == 0) return "before the first fault";
    const Fault& fault = schedule_[static_cast<std::size_t>(count - 1)];
    return fmt::format("fault {} of {} ({} {} for {} ms)", count, schedule_.size(), to_string(fault.kind), fault.target,
                       fault.lasts.count());
  }

  // What kept it from doing its work, if anything. After done().
  const Result<void>& result() const { return result_; }

 private:
  void work(std::stop_token stop) {
    const auto start = Clock::now();
    std::multimap<Clock::time_point, Fault> to_repair;
    const auto repair_until = [&](Clock::time_point time) {
      while (!to_repair.empty() && to_repair.begin()->first <= time) {
        common::pause_until(to_repair.begin()->first, stop);
        repair(to_repair.begin()->second);
        to_repair.erase(to_repair.begin());
      }
    };
    for (const Fault& fault : schedule_) {
      repair_until(start + fault.at);
      common::pause_until(start + fault.at, stop);
      if (stop.stop_requested() || !result_) break;
      commit(fault);
      ++faults_;
      to_repair.emplace(start + fault.at + fault.lasts, fault);
    }
    repair_until(Clock::time_point::max());
    done_ = true;
    common::wait_for(stop);  // workers that die with their parent were started by this thread
  }

  void commit(const Fault& fault) {
    switch (fault.kind) {
      case Fault::Kind::kKill:
        kill(pid_of(fault), SIGKILL);
        break;
      case Fault::Kind::kStall:
        kill(pid_of(fault), SIGSTOP);
        break;
      case Fault::Kind::kUnplug:
        hosts_->plug(kFirstWorkerHost + fault.target, false);
        break;
    }
  }

  void repair(const Fault& fault) {
    switch (fault.kind) {
      case Fault::Kind::kKill:
        if (auto ok = helpers_.replace(static_cast<std::size_t>(fault.target)); !ok) result_ = ok;
        break;
      case Fault::Kind::kStall:
        kill(pid_of(fault), SIGCONT);
        break;
      case Fault::Kind::kUnplug:
        hosts_->plug(kFirstWorkerHost + fault.target, true);
        break;
    }
  }

  // Ours until we wait for it, which only happens here.
  pid_t pid_of(const Fault& fault) const { return helpers_.pid(static_cast<std::size_t>(fault.target)); }

  const std::vector<Fault> schedule_;
  Helpers& helpers_;
  const common::Hosts* const hosts_;  // null: nothing to unplug
  Result<void> result_;
  std::atomic<int> faults_ = 0;
  std::atomic<bool> done_ = false;
  std::jthread thread_;  // last: uses all of the above
};

// Ends the process when a plan takes longer than its deadline allows.
class Watchdog {
 public:
  explicit Watchdog(std::uint64_t seed) : seed_(seed), thread_([this](std::stop_token stop) { watch(stop); }) {}

  void expect_by(Clock::time_point deadline, const std::function<std::string()>& where) {
    const std::lock_guard lock(mutex_);
    deadline_ = deadline + kHang;
    where_ = where;
    changed_.notify_all();
  }

  void rest() {
    const std::lock_guard lock(mutex_);
    deadline_.reset();
    changed_.notify_all();
  }

 private:
  void watch(std::stop_token stop) {
    std::unique_lock lock(mutex_);
    while (!stop.stop_requested()) {
      if (!deadline_) {
        changed_.wait(lock, stop, [&] { return deadline_.has_value(); });
        continue;
      }
      const auto until = *deadline_;
      if (changed_.wait_until(lock, stop, until, [&] { return deadline_ != until; }) || stop.stop_requested()) continue;
      fmt::print(stderr, "jostle bench: chaos with --seed {}: a plan hangs, {}\n", seed_, where_());
      std::_Exit(common::kExitBroken);
    }
  }

  const std::uint64_t seed_;
  std::mutex mutex_;  // guards deadline_ and where_
  std::condition_variable_any changed_;
  std::optional<Clock::time_point> deadline_;
  std::function<std::string()> where_;
  std::jthread thread_;
};

struct Report {
  std::vector<Fault> schedule;
  std::vector<double> undisturbed, disturbed;  // seconds of each plan
  Hash hash;                                   // of the undisturbed plan
  int unequal = 0;                             // plans
  double returned = common::kNone;             // seconds from the last repair until every worker could be used
  double seconds = 0.0;                        // from the first fault to the last plan's end
  physics_pool::PoolStatus pool;
  bool complete = false;  // no stop was requested

  int count(Fault::Kind kind) const { return static_cast<int>(std::ranges::count(schedule, kind, &Fault::kind)); }
};

Error at(const Error& error, const ChaosOptions& options, const std::string& where) {
  return {error.code, fmt::format("chaos with --seed {}: {}: {}", options.seed, where, error.message)};
}

class Chaos {
 public:
  Chaos(const ChaosOptions& options, const common::Hosts* hosts)
      : options_(options), hosts_(hosts), watchdog_(options.seed) {}

  Result<Report> run() {
    report_.schedule = chaos_schedule(options_.seed, options_.faults, options_.workers, hosts_ ? kWorkerHosts : 0);
    auto swarm_result =
        Swarm::start({.workers = options_.workers, .domain = options_.domain, .hosts = hosts_, .stop = options_.stop});
    if (!swarm_result) return swarm_result.error();
    Swarm& swarm = **swarm_result;
    auto plan_result = PlanAgain::make(swarm.pool(), kIterations);
    if (!plan_result) return plan_result.error();
    for (int i = 0; i < kUndisturbed; ++i) {
      auto ok = plan(*plan_result, report_.undisturbed, [] { return std::string("before the first fault"); });
      if (!ok) return ok.error();
    }
    const auto start = Clock::now();
    const auto disturbed = disturb(swarm, *plan_result);
    report_.complete = disturbed.has_value();
    if (!disturbed && (!options_.stop.stop_requested() || report_.disturbed.empty())) return disturbed.error();
    report_.seconds = seconds_since(start);
    report_.pool = swarm.pool().status();
    return std::move(report_);
  }

 private:
  Result<void> disturb(Swarm& swarm, const PlanAgain& again) {
    Saboteur saboteur(report_.schedule, swarm.helpers(), hosts_);
    const auto where = [&] { return saboteur.where(); };
    while (!saboteur.done()) {
      if (auto ok = plan(again, report_.disturbed, where); !ok) {
        report_.schedule.resize(static_cast<std::size_t>(saboteur.faults()));
        return ok;
      }
      tell(saboteur);
    }
    if (!saboteur.result()) return saboteur.result().error();
    const auto repaired = Clock::now();
    if (!swarm.pool().wait_for_workers(options_.workers, repaired + kReturn)) {
      std::string heard;
      for (const physics_pool::WorkerStatus& worker : swarm.pool().status().workers) {
        if (worker.alive) heard += fmt::format(" {}", worker.name);
      }
      return at({Code::kUnavailable, fmt::format("not all of {} workers could be used again within {} s; heard:{}",
                                                 options_.workers, kReturn.count(), heard)},
                options_, where());
    }
    report_.returned = seconds_since(repaired);
    return plan(again, report_.disturbed, [] { return std::string("after all faults"); });
  }

  Result<void> plan(const PlanAgain& again, std::vector<double>& seconds, const std::function<std::string()>& where) {
    const auto deadline = Clock::now() + kPlanPatience;
    watchdog_.expect_by(deadline, where);
    auto result = again.run(deadline, options_.stop);
    watchdog_.rest();
    if (!result && options_.stop.stop_requested()) return Error{Code::kCancelled, "interrupted"};
    if (!result) return at(result.error(), options_, where());
    if (report_.hash.empty()) report_.hash = result->hash;
    if (result->hash != report_.hash) {
      ++report_.unequal;
      options_.line->tell(fmt::format("WRONG: a plan differs from the first one, {}", where()));
    }
    seconds.push_back(result->value);
    return {};
  }

  void tell(const Saboteur& saboteur) {
    for (const int faults = saboteur.faults(); told_ < faults; ++told_) options_.line->step();
    options_.line->news(
        fmt::format("{} plans, the longest {:.1f} s", report_.disturbed.size(), std::ranges::max(report_.disturbed)));
  }

  const ChaosOptions& options_;
  const common::Hosts* const hosts_;
  Watchdog watchdog_;
  Report report_;
  int told_ = 0;  // faults
};

constexpr std::array kKinds{Fault::Kind::kKill, Fault::Kind::kStall, Fault::Kind::kUnplug};

void print(const Report& report, const ChaosOptions& options) {
  if (!report.complete) fmt::print("Partial: {} of {} faults.\n", report.schedule.size(), options.faults);
  fmt::print("chaos, seed {}: {} faults in {:.0f} s: {} kills, each replaced, {} stalls, {} unplugged hosts\n",
             options.seed, report.schedule.size(), report.seconds, report.count(Fault::Kind::kKill),
             report.count(Fault::Kind::kStall), report.count(Fault::Kind::kUnplug));
  fmt::print("  plans          {} meanwhile, median {:.2f} s, longest {:.2f} s; undisturbed {:.2f} s\n",
             report.disturbed.size(), common::median(report.disturbed), std::ranges::max(report.disturbed),
             common::median(report.undisturbed));
  fmt::print("  samples        {} handed out again, {} came twice or late\n", report.pool.reissued,
             report.pool.duplicates);
  if (report.complete)
    fmt::print("  workers        all {} usable {:.1f} s after the last repair\n", options.workers, report.returned);
  fmt::print("  all bit-equal  {}  {}\n", report.unequal == 0 ? "yes" : fmt::format("NO: {} differ", report.unequal),
             to_string(report.hash));
}

nlohmann::json to_json(const Report& report, const ChaosOptions& options) {
  nlohmann::json faults = nlohmann::json::object();
  for (const Fault::Kind kind : kKinds) faults[to_string(kind)] = report.count(kind);
  nlohmann::json object{{"name", "chaos"},
                        {"seed", options.seed},
                        {"workers", options.workers},
                        {"faults", faults},
                        {"seconds", report.seconds},
                        {"plans", report.disturbed.size()},
                        {"unequal", report.unequal},
                        {"hash", to_string(report.hash)},
                        {"undisturbed_s", report.undisturbed},
                        {"disturbed_s", report.disturbed},
                        {"returned_s", common::number_or_null(report.returned)},
                        {"reissued", report.pool.reissued},
                        {"duplicates", report.pool.duplicates}};
  if (!report.complete) object["partial"] = {{"done", report.schedule.size()}, {"of", options.faults}};
  return object;
}

}  // namespace

Result<bool> bench_chaos(const ChaosOptions& options) {
  options.line->expect(static_cast<std::size_t>(options.faults));
  auto hosts_result = common::Hosts::make(1 + kWorkerHosts);
  if (!hosts_result) options.line->tell(fmt::format("nothing is unplugged: {}", hosts_result.error().message));
  const common::Hosts* hosts = hosts_result ? hosts_result->get() : nullptr;
  std::optional<Result<Report>> result;
  const auto run = [&] { result = Chaos(options, hosts).run(); };
  hosts ? hosts->on(1, run) : run();
  if (!*result) return result->error();
  const Report& report = **result;
  options.line->end();
  print(report, options);
  if (!options.json.empty()) {
    if (auto ok = common::write_results(options.json, to_json(report, options)); !ok) return ok.error();
  }
  if (!report.complete) return Error{Code::kCancelled, "interrupted"};
  return report.unequal == 0;
}

namespace {

class ChaosBenchmark final : public Benchmark {
 public:
  ChaosBenchmark()
      : Benchmark("chaos", "plans while workers are killed, stalled and unplugged: all bit-equal, and how slow",
                  "2 min", Uses::kDomain) {}

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

}  // namespace

std::unique_ptr<Benchmark> chaos_benchmark() { return std::make_unique<ChaosBenchmark>(); }

}  // namespace jostle::studies
