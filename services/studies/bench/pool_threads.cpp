#include <algorithm>
#include <thread>

#include "physics_pool/local/thread_pool.hpp"
#include "services/studies/bench/benchmarks.hpp"
#include "services/studies/bench/workload.hpp"

namespace jostle::studies {

Result<void> measure_pool_threads(const Settings& settings) {
  settings.announce(1);
  const int threads = static_cast<int>(std::max(std::thread::hardware_concurrency(), 1u));
  auto scene_result = clutter(5);
  if (!scene_result) return scene_result.error();
  auto world_result = physics_pool::World::compile(*scene_result);
  if (!world_result) return world_result.error();
  physics_pool::ThreadPool pool(threads);
  if (auto loaded = pool.load(*scene_result); !loaded) return loaded.error();
  BareLoops loops(*world_result, threads);
  const auto batch = push(*scene_result, 3, 0.5, 16u * static_cast<unsigned>(threads));

  auto result = compare({"thread pool", [&] { return time_steps(pool, batch, settings.stop); }},
                        {"bare loops", [&]() -> Result<Sample> { return loops.run(batch); }}, settings.turns());
  if (!result) return result.error();
  result->name = "pool-threads";
  result->unit = "steps/s";
  result->aim = Aim{Aim::Kind::kAtLeast, 0.98};
  result->details = {{"threads", threads}};
  settings.keep(*std::move(result));
  return {};
}

}  // namespace jostle::studies
