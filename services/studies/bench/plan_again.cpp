#include "services/studies/bench/plan_again.hpp"

#include "services/studies/bench/workload.hpp"

namespace jostle::studies {

Result<PlanAgain> PlanAgain::make(physics_pool::Pool& pool, int iterations) {
  auto scene_result = clutter(5);
  if (!scene_result) return scene_result.error();
  auto world_result = pool.load(*scene_result);
  if (!world_result) return world_result.error();
  const physics_pool::RolloutBatch straight = push(*scene_result, 3, 1.0, 1);
  planners::Problem problem{
      .world = *world_result, .x0 = straight.x0, .initial = straight.nominal, .iterations = iterations, .seed = 1};
  problem.objective["obstruction"].weight = 0.0;
  problem.objective.success_cost = 1e-9;  // never content
  return PlanAgain(pool, std::move(problem));
}

Result<Sample> PlanAgain::run(physics_pool::TimePoint deadline, std::stop_token stop) const {
  planners::PbstoOptions options;
  planners::Pbsto planner(*pool_, options);
  const auto start = std::chrono::steady_clock::now();
  auto plan_result = planner.plan(problem_, deadline, std::move(stop));
  const double seconds = seconds_since(start);
  if (!plan_result) return plan_result.error();
  std::vector<State> all = plan_result->states;
  all.push_back({.q = plan_result->controls.values, .v = {plan_result->cost}});
  return Sample{.value = seconds, .hash = hash_of_states(all)};
}

}  // namespace jostle::studies
