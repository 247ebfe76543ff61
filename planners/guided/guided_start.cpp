#include "planners/guided/guided_start.hpp"

#include <algorithm>

namespace jostle::planners {
namespace {

constexpr int kMostIterations = 4;  // of the guide

}  // namespace

Result<Plan> GuidedStart::plan(const Problem& problem, TimePoint deadline, std::stop_token stop) {
  if (const auto* state = problem.objective.find("state"); state && !state->values.empty()) {
    return planner_->plan(problem, deadline, std::move(stop));
  }
  Problem guided = problem;
  guided.iterations = std::min(problem.iterations, kMostIterations);
  auto way_result = guide_->plan(guided, deadline, stop);
  if (!way_result) return way_result;
  Problem begun = problem;
  begun.initial = std::move(way_result->controls);
  const std::vector<double> still(static_cast<std::size_t>(problem.initial.nu), 0.0);
  while (begun.initial.steps() < problem.initial.steps()) begun.initial.append(still);
  begun.rollouts -= std::min(problem.rollouts, way_result->rollouts);
  auto plan_result = planner_->plan(begun, deadline, std::move(stop));
  if (!plan_result) return plan_result;
  plan_result->rollouts += way_result->rollouts;
  plan_result->iterations += way_result->iterations;
  return plan_result;
}

}  // namespace jostle::planners
