#include <fmt/format.h>

#include <algorithm>
#include <condition_variable>
#include <limits>
#include <mutex>
#include <optional>
#include <thread>
#include <vector>

#include "services/common/process/program.hpp"
#include "services/studies/bench/several_hosts.hpp"
#include "services/studies/bench/swarm.hpp"
#include "services/studies/bench/workload.hpp"

namespace jostle::studies {
namespace {

using Clock = std::chrono::steady_clock;

constexpr int kWorkers = 2;  // one per host
constexpr int kVictim = 3;   // host
constexpr const char* kThere = "worker-1";
// As many samples as a plan of Alg. 1 has, waiting instead of simulating: what is measured is
// how work is handed out, not who else uses this machine's cores.
constexpr int kIterations = 12;
constexpr std::uint32_t kSamples = 8;
constexpr std::chrono::milliseconds kWait{100};     // each; 0.4 s an iteration, 4.8 s in all
constexpr std::chrono::milliseconds kBefore{1000};  // from the first result to the unplugging
// Shorter than silence makes a worker dead (0.5 s), longer, and longer than the
// middleware's lease (2 s), after which the processes have to find each other again.
constexpr std::chrono::milliseconds kAway[] = {std::chrono::milliseconds(300), std::chrono::milliseconds(1000),
                                               std::chrono::milliseconds(3000)};

// Hears of every result, from the pool's thread.
class Ear {
 public:
  void hear(const pool::SampleTrace& trace) {
    const std::lock_guard lock(mutex_);
    newest_ = Clock::now();
    if (trace.worker_name == kThere) newest_there_ = newest_;
    heard_.notify_all();
  }

  // When the first result after `since` came, of the victim's alone if told so.
  std::optional<Clock::time_point> next(Clock::time_point since, bool there, std::stop_token stop) {
    std::unique_lock lock(mutex_);
    const Clock::time_point& newest = there ? newest_there_ : newest_;
    if (!heard_.wait(lock, stop, [&] { return newest > since; })) return {};
    return newest;
  }

 private:
  std::mutex mutex_;  // guards the times
  std::condition_variable_any heard_;
  Clock::time_point newest_, newest_there_;
};

// What a plan asks of a pool.
class Work {
 public:
  static Result<Work> make(pool::RemotePool& pool) {
    auto scene_result = clutter(5);
    if (!scene_result) return scene_result.error();
    if (auto loaded = pool.load(*scene_result); !loaded) return loaded.error();
    physics_pool::RolloutBatch batch = push(*scene_result, 3, 1.0, kSamples);
    batch.wait = kWait;
    return Work(pool, std::move(batch));
  }

  Result<Sample> run(std::stop_token stop) const {
    const auto start = Clock::now();
    std::vector<physics_pool::RolloutOutcome> outcomes;
    for (int i = 0; i < kIterations; ++i) {
      auto reply_result = pool_->run(batch_, start + kPatience, stop);
      if (!reply_result) return reply_result.error();
      outcomes.insert(outcomes.end(), reply_result->outcomes.begin(), reply_result->outcomes.end());
    }
    return Sample{.value = seconds_since(start), .hash = hash_of_answers(outcomes)};
  }

 private:
  Work(pool::RemotePool& pool, physics_pool::RolloutBatch batch) : pool_(&pool), batch_(std::move(batch)) {}

  pool::RemotePool* pool_;  // never null
  physics_pool::RolloutBatch batch_;
};

class Outage {
 public:
  Outage(const common::Hosts& hosts, Ear& ear, Swarm& swarm, std::chrono::milliseconds away)
      : hosts_(hosts), ear_(ear), swarm_(swarm), away_(away) {}

  // All of it with the outage in it.
  Result<Sample> run(const Work& work, std::stop_token stop) {
    const auto start = Clock::now();
    std::jthread saboteur([&](std::stop_token over) { unplug(start, over); });
    auto result = work.run(stop);
    saboteur.request_stop();
    saboteur.join();
    if (auto ok = wait_for_all(); !ok) return ok.error();
    return result;
  }

  // Both workers can be used, so that the other side finds what it needs.
  Result<void> wait_for_all() const {
    if (swarm_.pool().wait_for_workers(kWorkers, Clock::now() + kLongestReturn)) return {};
    return Error{Code::kUnavailable, fmt::format("unplugged: the worker on host {} is not back after {} s", kVictim,
                                                 kLongestReturn.count())};
  }

  // Seconds from plugging it in to the next result from there, in the same run; infinite if there was none. Of the
  // runs that count: the first one of compare() does not.
  std::vector<double> returns() const {
    if (returns_.empty()) return {};
    return {returns_.begin() + 1, returns_.end()};
  }

 private:
  static constexpr std::chrono::seconds kLongestReturn{20};

  void unplug(Clock::time_point start, std::stop_token over) {
    const auto first = ear_.next(start, false, over);
    if (!first) return;
    common::pause_until(*first + kBefore, over);
    hosts_.plug(kVictim, false);
    common::pause_until(Clock::now() + away_, over);
    const auto in = Clock::now();
    hosts_.plug(kVictim, true);
    const auto back = ear_.next(in, true, over);
    returns_.push_back(back ? std::chrono::duration<double>(*back - in).count()
                            : std::numeric_limits<double>::infinity());
  }

  const common::Hosts& hosts_;
  Ear& ear_;
  Swarm& swarm_;
  const std::chrono::milliseconds away_;
  std::vector<double> returns_;
};

Result<Measurement> measure_outage(const common::Hosts& hosts, std::chrono::milliseconds away,
                                   const Settings& settings) {
  Ear ear;
  auto swarm_result = Swarm::start({.workers = kWorkers,
                                    .domain = settings.domain,
                                    .hosts = &hosts,
                                    .pool = {.on_sample = [&](const pool::SampleTrace& trace) { ear.hear(trace); }},
                                    .stop = settings.stop});
  if (!swarm_result) return swarm_result.error();
  Swarm& swarm = **swarm_result;
  auto work_result = Work::make(swarm.pool());
  if (!work_result) return work_result.error();
  Outage outage(hosts, ear, swarm, away);

  auto result = compare({"unplugged", [&] { return outage.run(*work_result, settings.stop); }},
                        {"left alone", [&] { return work_result->run(settings.stop); }}, swarm.turns(settings.turns()));
  if (!result) return result.error();
  result->name = fmt::format("unplugged/{:.1f}s", std::chrono::duration<double>(away).count());
  result->unit = "s";
  std::vector<double> costs;
  for (std::size_t i = 0; i < result->a.size(); ++i) costs.push_back(result->a[i] - result->b[i]);
  const common::Interval interval = common::median_interval(costs);
  // One of two workers is away: what it would have done takes both of them half as long.
  const double floor = std::chrono::duration<double>(away).count() / kWorkers;
  const std::vector<double> returns = outage.returns();
  result->details = {{"cost_s", common::median(costs)},
                     {"cost_low_s", interval.low},
                     {"cost_high_s", interval.high},
                     {"worst_cost_s", std::ranges::max(costs)},
                     {"capacity_lost_s", floor},
                     {"used_again_after_s", common::median(returns)},
                     {"used_again_at_worst_s", common::quantile(returns, 1.0)}};
  return result;
}

}  // namespace

Result<void> measure_unplugged(const Settings& settings) {
  const std::pair<const char*, common::LinkQuality> links[] = {{"good", {}}, {"bad", kBadLink}};
  settings.announce(static_cast<int>(std::size(links) * std::size(kAway)));
  for (const auto& [name, quality] : links) {
    auto ok = measure_on_hosts(1 + kWorkers, quality, [&](const common::Hosts& hosts) -> Result<void> {
      for (const std::chrono::milliseconds away : kAway) {
        auto outage_result = measure_outage(hosts, away, settings);
        if (!outage_result) return outage_result.error();
        outage_result->name += fmt::format("/{}", name);
        settings.keep(*std::move(outage_result));
      }
      return {};
    });
    if (!ok) return ok;
  }
  return {};
}

}  // namespace jostle::studies
