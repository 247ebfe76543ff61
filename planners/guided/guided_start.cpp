#include "planners/guided/guided_start.hpp"

#include <algorithm>
#include <utility>

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
  ControlSequence initial = std::move(way_result->controls);
  return plan_from(*planner_, problem, std::move(initial), *way_result, deadline, std::move(stop));
}

Result<Plan> plan_from(Planner& planner, const Problem& problem, ControlSequence initial, const Plan& way,
                       TimePoint deadline, std::stop_token stop) {
  Problem begun = problem;
  begun.initial = std::move(initial);
  const std::vector<double> still(static_cast<std::size_t>(problem.initial.nu), 0.0);
  while (begun.initial.steps() < problem.initial.steps()) begun.initial.append(still);
  begun.rollouts -= std::min(problem.rollouts, way.rollouts);
  auto plan_result = planner.plan(begun, deadline, std::move(stop));
  if (!plan_result) return plan_result;
  plan_result->rollouts += way.rollouts;
  plan_result->iterations += way.iterations;
  return plan_result;
}

}  // namespace jostle::planners
