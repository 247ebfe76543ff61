#include "planners/execution/plan_ahead.hpp"

#include <utility>

namespace jostle::planners {

PlanAhead::PlanAhead(Steps steps, const std::stop_token& stop)
    : forward_(stop, [this] { stop_.request_stop(); }),
      plan_(Error{Code::kInternal, "plan ahead: not made"}),
      thread_([this, steps = std::move(steps)] { work(steps, stop_.get_token()); }) {}

PlanAhead::~PlanAhead() { give_up(); }

void PlanAhead::work(const Steps& steps, const std::stop_token& stop) {
  if (auto predicted_result = steps.predict(stop)) {
    predicted_ = std::move(predicted_result).value();
    if (auto problem_result = steps.ask(*predicted_)) problem_ = std::move(problem_result).value();
  }
  if (problem_) problem_->rollouts_asked_for = &rollouts_;
  asked_.count_down();
  if (problem_) plan_ = steps.plan(*problem_, stop);
}

Result<Plan> PlanAhead::take() {
  if (thread_.joinable()) thread_.join();
  return std::move(plan_);
}

void PlanAhead::give_up() {
  stop_.request_stop();
  if (thread_.joinable()) thread_.join();
}

}  // namespace jostle::planners
