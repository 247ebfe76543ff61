#include "services/studies/bench/catalogue.hpp"

#include <type_traits>

#include "services/studies/bench/ratio.hpp"

namespace jostle::studies {

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
  all.push_back(arm_reaches_benchmark());
  add(ratio, "bag", "messages into a bag against bare appends of the same bytes", "15 s", kNothing, 7, measure_bag);
  all.push_back(chaos_benchmark());
  all.push_back(cheap_physics_benchmark());
  add(ratio, "coarse-models", "coarse models against the fine one, per control step", "15 s", kNothing, 9,
      measure_coarse_models);
  add(ratio, "early-stop", "a batch that stops its losers against one that does not", "2 min", kNothing, 5,
      measure_early_stop);
  all.push_back(coarse_grasp_benchmark());
  all.push_back(estimator_benchmark());
  all.push_back(first_plan_benchmark());
  all.push_back(fleet_curve_benchmark());
  add(ratio, "hosts", "between two hosts: round trip and throughput, protected against unprotected", "5 min", kDomain,
      9, measure_hosts);
  add(of_workers, "hosts-scheduling", "waiting workers on several hosts against workers that never idle", "1 min",
      kDomain, 5, measure_hosts_scheduling);
  all.push_back(idle_benchmark());
  add(std::type_identity<RatioOfLanes>(), "lanes",
      "waiting threads of one worker per host against threads that never idle", "1 min", kDomain, 5, measure_lanes);
  add(ratio, "parareal", "Parareal on all processors against what Eq. 6.4 allows", "15 s", kNothing, 15,
      measure_parareal);
  add(ratio, "parareal-scheduling", "Parareal on 4 to 32 waiting workers against Eq. 6.4", "1 min", kDomain, 9,
      measure_parareal_scheduling);
  add(ratio, "play", "a bag as a subscriber hears it against the bag, at rates from 0.1 to 10", "5 min", kDomain, 3,
      measure_play);
  all.push_back(pool_timeline_benchmark());
  add(ratio, "pool-dds", "two worker processes against two bare loops", "15 s", kDomain, 15, measure_pool_dds);
  add(ratio, "pool-threads", "ThreadPool against bare loops of engine steps", "15 s", kNothing, 15,
      measure_pool_threads);
  all.push_back(record_benchmark());
  add(ratio, "robust-iteration", "an iteration of RobustSTO on waiting threads against one rollout (Eq. 4.43)", "2 min",
      kNothing, 7, measure_robust_iteration);
  add(ratio, "round-trip", "an empty assignment through the pool against a bare Fast DDS echo", "2 s", kDomain, 25,
      measure_round_trip);
  add(of_workers, "scheduling", "waiting workers against workers that never idle", "30 s", kDomain, 5,
      measure_scheduling);
  all.push_back(tags_benchmark());
  add(ratio, "unplugged", "work one of whose two hosts is unplugged for a while against work left alone", "7 min",
      kDomain, 5, measure_unplugged);
  add(ratio, "viewers", "a run that two viewers look at against one that nobody looks at", "3 min", kDomain, 15,
      measure_viewers);
  all.push_back(echo_server_benchmark());
  all.push_back(publisher_benchmark());
  return all;
}

}  // namespace jostle::studies
