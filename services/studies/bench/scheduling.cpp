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

Result<Measurement> measure_with(int workers, const Settings& settings, const common::Hosts* hosts = nullptr) {
  auto scene_result = clutter(5);
  if (!scene_result) return scene_result.error();
  RolloutBatch batch = push(*scene_result, 3, 0.5, static_cast<std::uint32_t>(kTasksPerWorker * workers));
  batch.wait = kWait;

  const auto start = std::chrono::steady_clock::now();
  auto swarm_result =
      Swarm::start({.workers = workers, .domain = settings.domain, .hosts = hosts, .stop = settings.stop});
  if (!swarm_result) return swarm_result.error();
  const double gathering = seconds_since(start);
  pool::RemotePool& pool = (*swarm_result)->pool();
  if (auto loaded = pool.load(*scene_result); !loaded) return loaded.error();

  auto result = compare({"without gaps", [&]() -> Result<Sample> { return waiting_without_gaps(batch, workers); }},
                        {"pool over DDS", [&] { return time_waiting(pool, batch, settings.stop); }},
                        (*swarm_result)->turns(settings.turns()));
  if (!result) return result.error();
  result->name = fmt::format("scheduling/{}", workers);
  result->unit = "ms";
  result->aim = Aim{Aim::Kind::kAtLeast, 0.95};
  const physics_pool::PoolStatus status = pool.status();
  result->details = {{"workers", workers},
                     {"tasks", batch.samples},
                     {"gathering_s", gathering},
                     {"reissued", static_cast<double>(status.reissued)},
                     {"duplicates", static_cast<double>(status.duplicates)}};
  return result;
}

// A host has ports for about a hundred participants of a domain.
int hosts_for(int workers) { return std::clamp((workers + kWorkersPerHost - 1) / kWorkersPerHost, 2, 8); }

// Workers need not know of each other: a discovery server introduces each to the client
// alone, where everybody else's way costs exchanges that grow with the square of their number.
Result<Measurement> measure_across(int workers, const Settings& settings, const common::Hosts& hosts) {
  Helpers server(settings.domain, {});
  const char* way = std::getenv("JOSTLE_DISCOVERY");
  if (!way) {
    setenv("JOSTLE_DISCOVERY", fmt::format("server:{}", common::Hosts::address(1)).c_str(), 1);
    if (auto ok = server.start("jostle_discovery_server", {}); !ok) return ok.error();
  }
  auto result = measure_with(workers, settings, &hosts);
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
    auto result = measure_with(workers, settings);
    if (!result) return result.error();
    settings.keep(*std::move(result));
  }
  return {};
}

Result<void> measure_hosts_scheduling(const Settings& settings) {
  settings.announce(static_cast<int>(settings.workers.size()));
  for (const int workers : settings.workers) {
    auto ok = measure_on_hosts(1 + hosts_for(workers), {}, [&](const common::Hosts& hosts) -> Result<void> {
      auto one_result = measure_across(workers, settings, hosts);
      if (!one_result) return one_result.error();
      settings.keep(*std::move(one_result));
      return {};
    });
    if (!ok) return ok;
  }
  return {};
}

}  // namespace jostle::studies
