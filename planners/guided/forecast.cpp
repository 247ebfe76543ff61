#include "planners/guided/forecast.hpp"

#include <cmath>

namespace jostle::planners {
namespace {

// In units of cost. More than any way that drops nothing costs.
constexpr double kNoSuccess = 10'000.0;
// What lodges, whatever the objective says: the default weight of its own term.
constexpr double kLodged = 1000.0;

}  // namespace

double Forecast::rank() const { return (succeeds ? 0.0 : kNoSuccess) + cost + kLodged * lodged; }

Forecast Forecaster::run(const ForecastProblem& problem, const physics_pool::Scorer& scorer, const State& x,
                         std::span<const double> u_before, const ControlSequence& controls, int first, double so_far) {
  const physics_pool::TaskGeometry& geometry = problem.geometry;
  before_ = x;
  Forecast forecast;
  double sum = so_far;
  for (int t = first; t < controls.steps(); ++t) {
    const std::span<const double> u = controls.step(t);
    after_ = before_;
    model_.advance(after_, u, problem.step_duration);
    sum += scorer.running({.geometry = geometry,
                           .u_before = t == first ? u_before : controls.step(t - 1),
                           .u = u,
                           .x0 = before_,
                           .x1 = after_,
                           .facts = {}});
    if (!std::isfinite(sum)) return {};
    forecast.steps = t + 1;
    // A rollout ends early from n_min on; at its end it may be at the goal as well.
    const bool may_succeed = t >= problem.min_steps || t + 1 == controls.steps();
    if (may_succeed && scorer.at_goal(geometry, after_)) {
      const double cost = sum + scorer.final(geometry, after_);
      if (cost <= problem.objective.success_cost) {
        forecast.cost = cost;
        forecast.succeeds = true;
        break;
      }
    }
    forecast.cost = sum;
    // What has been dropped stays down, and pays in every step.
    if (sum > 10 * problem.objective.success_cost) break;
    if (t + 1 == controls.steps()) forecast.cost += scorer.final(geometry, after_);
    std::swap(before_, after_);
  }
  forecast.lodged = count_obstructions(geometry, forecast.succeeds ? after_ : before_);
  return forecast;
}

}  // namespace jostle::planners
