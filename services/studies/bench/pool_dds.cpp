#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/swarm.hpp"
#include "services/studies/bench/workload.hpp"

namespace jostle::studies {

Result<void> measure_pool_dds(const Settings& settings) {
  settings.announce(1);
  constexpr int kWorkers = 2;
  auto scene_result = clutter(5);
  if (!scene_result) return scene_result.error();
  auto world_result = physics_pool::World::compile(*scene_result);
  if (!world_result) return world_result.error();
  auto swarm_result = Swarm::start({.workers = kWorkers, .domain = settings.domain, .stop = settings.stop});
  if (!swarm_result) return swarm_result.error();
  pool::RemotePool& pool = (*swarm_result)->pool();
  if (auto loaded = pool.load(*scene_result); !loaded) return loaded.error();
  BareLoops loops(*world_result, kWorkers);
  const auto batch = push(*scene_result, 3, 0.5, 16 * kWorkers);

  auto result = compare({"pool over DDS", [&] { return time_steps(pool, batch, settings.stop); }},
                        {"bare loops", [&]() -> Result<Sample> { return loops.run(batch); }},
                        (*swarm_result)->turns(settings.turns()));
  if (!result) return result.error();
  result->name = "pool-dds";
  result->unit = "steps/s";
  result->aim = Aim{Aim::Kind::kAtLeast, 0.95};
  result->details = {{"workers", kWorkers}};
  settings.keep(*std::move(result));
  return {};
}

}  // namespace jostle::studies
