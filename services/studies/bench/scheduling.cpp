#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/several_hosts.hpp"
#include "services/studies/bench/swarm.hpp"
#include "services/studies/bench/workload.hpp"

namespace jostle::studies {
namespace {

using physics_pool::End;
using physics_pool::RolloutBatch;
using physics_pool::RolloutOutcome;

constexpr std::chrono::milliseconds kWait{50};
constexpr int kTasksPerWorker = 10;
constexpr int kTasksPerLane = 20;
constexpr int kWorkersPerHost = 32;

double milliseconds(double seconds) { return 1e3 * seconds; }

Result<Sample> time_waiting(pool::RemotePool& pool, const RolloutBatch& batch, std::stop_token stop) {
  const auto start = std::chrono::steady_clock::now();
  auto reply_result = pool.run(batch, start + kPatience, stop);
  const double seconds = seconds_since(start);
  if (!reply_result) return reply_result.error();
  return Sample{.value = milliseconds(seconds), .hash = hash_of_answers(reply_result->outcomes)};
}

// Nobody idles: every worker waits for its share, back to back.
Sample waiting_without_gaps(const RolloutBatch& batch, int workers) {
  std::vector<RolloutOutcome> outcomes;
  for (std::uint32_t i = 0; i < batch.samples; ++i) {
    outcomes.push_back({.sample = batch.first_sample + i, .end = End::kCompleted, .cost = 0.0});
  }
  const double seconds = std::chrono::duration<double>(*batch.wait).count() * batch.samples / workers;
  return {.value = milliseconds(seconds), .hash = hash_of_answers(outcomes)};
}

// Who waits, and for how many tasks.
struct Crew {
  int workers = 1;
  int threads = 1;              // of each
  int tasks = kTasksPerWorker;  // per thread
  int steps = 3;                // control steps of the plan, which says how long an assignment is

  int lanes() const { return workers * threads; }
};

Result<Measurement> measure_with(const Crew& crew, const Settings& settings, const common::Hosts* hosts = nullptr) {
  auto scene_result = clutter(5);
  if (!scene_result) return scene_result.error();
  RolloutBatch batch = push(*scene_result, crew.steps, 0.5, static_cast<std::uint32_t>(crew.tasks * crew.lanes()));
  batch.wait = kWait;

  const auto start = std::chrono::steady_clock::now();
  auto swarm_result = Swarm::start({.workers = crew.workers,
                                    .threads = crew.threads,
                                    .domain = settings.domain,
                                    .hosts = hosts,
                                    .stop = settings.stop});
  if (!swarm_result) return swarm_result.error();
  const double gathering = seconds_since(start);
  pool::RemotePool& pool = (*swarm_result)->pool();
  if (auto loaded = pool.load(*scene_result); !loaded) return loaded.error();

  std::vector<double> client_cpu;  // s, of each run
  const auto run = [&] {
    const double before = own_cpu_seconds();
    auto sample_result = time_waiting(pool, batch, settings.stop);
    client_cpu.push_back(own_cpu_seconds() - before);
    return sample_result;
  };
  auto result = compare({"without gaps", [&]() -> Result<Sample> { return waiting_without_gaps(batch, crew.lanes()); }},
                        {"pool over DDS", run}, (*swarm_result)->turns(settings.turns()));
  if (!result) return result.error();
  result->name = fmt::format("scheduling/{}", crew.workers);
  result->unit = "ms";
  result->aim = Aim{Aim::Kind::kAtLeast, 0.95};
  const physics_pool::PoolStatus status = pool.status();
  const pool::Traffic traffic = pool.traffic();
  const double cpu_per_task = 1e6 * common::median(client_cpu) / batch.samples;
  const auto each = [](std::uint64_t samples, std::uint64_t messages) {
    return static_cast<double>(samples) / static_cast<double>(messages);
  };
  result->details = {{"workers", crew.workers},
                     {"lanes", crew.lanes()},
                     {"tasks", batch.samples},
                     {"gathering_s", gathering},
                     {"reissued", static_cast<double>(status.reissued)},
                     {"duplicates", static_cast<double>(status.duplicates)},
                     {"client_cpu_us_per_sample", cpu_per_task},
                     {"all_cpu_us_per_sample", 1e6 * common::median(result->cpu_b) / batch.samples},
                     {"samples_per_assignment", each(traffic.samples_out, traffic.assignments)},
                     {"samples_per_answer", each(traffic.samples_back, traffic.answers)},
                     {"kb_per_lane", 1e-3 * (*swarm_result)->helpers().memory() / crew.lanes()}};
  return result;
}

// A host has ports for about a hundred participants of a domain.
int hosts_for(int workers) { return std::clamp((workers + kWorkersPerHost - 1) / kWorkersPerHost, 2, 8); }

// Workers need not know of each other: a discovery server introduces each to the client
// alone, where everybody else's way costs exchanges that grow with the square of their number.
Result<Measurement> measure_across(const Crew& crew, const Settings& settings, const common::Hosts& hosts) {
  Helpers server(settings.domain, {});
  const char* way = std::getenv("JOSTLE_DISCOVERY");
  if (!way) {
    setenv("JOSTLE_DISCOVERY", fmt::format("server:{}", common::Hosts::address(1)).c_str(), 1);
    if (auto ok = server.start("jostle_discovery_server", {}); !ok) return ok.error();
  }
  auto result = measure_with(crew, settings, &hosts);
  if (!way) unsetenv("JOSTLE_DISCOVERY");
  if (!result) return result.error();
  result->name = fmt::format("hosts-{}", result->name);
  result->details.emplace_back("hosts", hosts.count() - 1);
  return result;
}

}  // namespace

Result<void> measure_scheduling(const Settings& settings) {
  settings.announce(static_cast<int>(settings.workers.size()));
  for (const int workers : settings.workers) {
    auto result = measure_with({.workers = workers}, settings);
    if (!result) return result.error();
    settings.keep(*std::move(result));
  }
  return {};
}

Result<void> measure_hosts_scheduling(const Settings& settings) {
  settings.announce(static_cast<int>(settings.workers.size()));
  for (const int workers : settings.workers) {
    auto ok = measure_on_hosts(1 + hosts_for(workers), {}, [&](const common::Hosts& hosts) -> Result<void> {
      auto one_result = measure_across({.workers = workers}, settings, hosts);
      if (!one_result) return one_result.error();
      settings.keep(*std::move(one_result));
      return {};
    });
    if (!ok) return ok;
  }
  return {};
}

Result<void> measure_lanes(const Settings& settings) {
  settings.announce(static_cast<int>(settings.hosts.size()));
  for (const int count : settings.hosts) {
    const Crew crew{.workers = count, .threads = settings.lanes, .tasks = kTasksPerLane, .steps = settings.steps};
    auto ok = measure_on_hosts(1 + count, {}, [&](const common::Hosts& hosts) -> Result<void> {
      auto one_result = measure_across(crew, settings, hosts);
      if (!one_result) return one_result.error();
      one_result->name = fmt::format("lanes/{}x{}", count, settings.lanes);
      one_result->aim = Aim{.kind = Aim::Kind::kAtLeast, .ratio = crew.lanes() > 64 ? 0.9 : 0.97};
      settings.keep(*std::move(one_result));
      return {};
    });
    if (!ok) return ok;
  }
  return {};
}

}  // namespace jostle::studies
