#include "planners/execution/execution.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace jostle::planners {

const char* to_string(Ending ending) {
  switch (ending) {
    case Ending::kUnknown:
      return "unknown";
    case Ending::kSucceeded:
      return "succeeded";
    case Ending::kFailed:
      return "failed";
    case Ending::kTimedOut:
      return "timed out";
    case Ending::kCancelled:
      return "cancelled";
    case Ending::kBroken:
      return "broken";
    case Ending::kRefused:
      return "refused";
  }
  return "unknown";
}

void Outcome::conclude(Ending how, std::string why) {
  ending = how;
  success = how == Ending::kSucceeded;
  reason = std::move(why);
}

Execution::Execution(const ControlSetup& setup, double step_duration, const OnEvent& on_event, std::stop_token stop)
    : setup_(setup),
      step_duration_(step_duration),
      on_event_(on_event),
      stop_(std::move(stop)),
      start_(Clock::now()),
      deadline_(start_ + setup.limits.timeout) {}

Result<void> Execution::observe() {
  auto robot_result = setup_.robot.read(stop_);
  if (!robot_result) return robot_result.error();
  auto objects_result = setup_.objects.read();
  if (!objects_result) return objects_result.error();
  auto state_result = assemble_state(layout(), *robot_result, *objects_result);
  if (!state_result) return state_result.error();
  reading_ = std::move(robot_result).value();
  x_ = std::move(state_result).value();
  outcome_.observed.push_back(x_);
  outcome_.dropped.clear();
  for (const int i : physics_pool::dropped_objects(setup_.geometry, x_, setup_.objective.value("drop", "height"))) {
    outcome_.dropped.push_back(layout().objects[static_cast<std::size_t>(i)].name);
  }
  return {};
}

Result<void> Execution::plan(const ControlSequence& initial, int iterations, const physics_pool::Objective& objective,
                             std::vector<double> u_before, bool weigh_robustness) {
  notify(Phase::kPlanning);
  const auto before = Clock::now();
  if (rollouts_left() == 0) {
    is_out_of_rollouts_ = true;
    return Error{Code::kDeadline, "task: out of rollouts"};
  }
  auto start_result = setup_.make_feasible ? setup_.make_feasible(x_) : Result<State>(x_);
  if (!start_result) return start_result.error();
  Problem problem{.world = setup_.world,
                  .x0 = std::move(start_result).value(),
                  .initial = initial,
                  .u_before = std::move(u_before),
                  .iterations = iterations,
                  .rollouts = rollouts_left(),
                  .seed = setup_.seed,
                  .stream = stream_,
                  .objective = objective,
                  .weigh_robustness = weigh_robustness,
                  // From the first action on a robot stands still for as long as this takes.
                  .priority = outcome_.actions > 0 ? physics_pool::Priority::kUrgent : physics_pool::Priority::kNormal};
  std::uint64_t asked_for = 0;
  problem.rollouts_asked_for = &asked_for;
  auto plan_result = setup_.planner.plan(problem, deadline_, stop_);
  outcome_.planning_time += Clock::now() - before;
  if (!plan_result) {
    outcome_.rollouts += asked_for;
    return plan_result.error();
  }
  plan_ = std::move(plan_result).value();
  acted_at_plan_ = outcome_.actions;
  stream_ += static_cast<std::uint32_t>(iterations);
  outcome_.rollouts += plan_.rollouts;
  outcome_.iterations += plan_.iterations;
  if (!planned_) {
    planned_ = true;
    outcome_.first_plan = plan_;
    outcome_.plan_time = outcome_.planning_time;
  }
  return {};
}

Result<void> Execution::act() {
  notify(Phase::kActing);
  if (Clock::now() >= deadline_) return Error{Code::kDeadline, "task: out of time"};
  if (auto ok = setup_.robot.execute(plan_.controls.step(0), step_duration_, stop_); !ok) return ok;
  ++outcome_.actions;
  plan_.controls.drop_first();
  plan_.states.erase(plan_.states.begin());
  return observe();
}

Result<void> Execution::rest(double duration) {
  if (duration <= 0) return {};
  const std::vector<double> none(static_cast<std::size_t>(layout().nu), 0.0);
  if (auto ok = setup_.robot.execute(none, duration, stop_); !ok) return ok;
  return observe();
}

Result<void> Execution::move(std::span<const double> u, Phase phase) {
  notify(phase);
  if (auto ok = setup_.robot.execute(u, step_duration_, stop_); !ok) return ok;
  return observe();
}

Result<Outcome> Execution::end(const Result<void>& ended) {
  outcome_.total_time = Clock::now() - start_;
  if (!ended) conclude_early(ended.error());
  notify(Phase::kDone);
  if (ended || ended.error().code == Code::kDeadline) return std::move(outcome_);
  return ended.error();
}

void Execution::conclude_early(const Error& why) {
  switch (why.code) {
    case Code::kDeadline:
      return outcome_.conclude(
          Ending::kTimedOut, is_out_of_rollouts_ ? fmt::format("all {} rollouts are spent", setup_.limits.rollouts)
                                                 : fmt::format("timeout after {:.0f} s", outcome_.total_time.count()));
    case Code::kCancelled:
      return outcome_.conclude(Ending::kCancelled, "cancelled");
    default:
      return outcome_.conclude(Ending::kBroken, why.message);
  }
}

std::uint64_t Execution::rollouts_left() const {
  if (setup_.limits.rollouts == 0) return UINT64_MAX;
  return setup_.limits.rollouts - std::min(setup_.limits.rollouts, outcome_.rollouts);
}

void Execution::notify(Phase phase) const {
  if (!on_event_) return;
  on_event_({.phase = phase, .outcome = outcome_, .plan = planned_ ? &plan_ : nullptr, .observed = &x_});
}

Result<State> assemble_state(const StateLayout& layout, const robot_bridge::RobotReading& robot,
                             const std::vector<perception::ObjectReading>& objects) {
  if (robot.q.size() != layout.joints.size() || robot.v.size() != layout.joints.size()) {
    return Error{Code::kInvalidArgument, fmt::format("robot: got {} positions and {} velocities, wanted {} joints",
                                                     robot.q.size(), robot.v.size(), layout.joints.size())};
  }
  State x;
  x.q = robot.q;
  x.v = robot.v;
  for (const ObjectSlot& slot : layout.objects) {
    const auto found = std::ranges::find(objects, slot.name, &perception::ObjectReading::name);
    if (found == objects.end()) {
      return Error{Code::kInvalidArgument,
                   fmt::format("objects: no measurement of '{}', wanted all {} objects of the scene", slot.name,
                               layout.objects.size())};
    }
    x.q.insert(x.q.end(), found->position.begin(), found->position.end());
    x.q.insert(x.q.end(), found->orientation.begin(), found->orientation.end());
    x.v.insert(x.v.end(), found->linear.begin(), found->linear.end());
    x.v.insert(x.v.end(), found->angular.begin(), found->angular.end());
  }
  return x;
}

}  // namespace jostle::planners
