#include "planners/execution/execution.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "physics_pool/objective/scorer.hpp"
#include "physics_pool/task/state_distance.hpp"

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
    case Ending::kInvalid:
      return "invalid";
  }
  return "unknown";
}

void Outcome::conclude(Ending how, std::string why) {
  ending = how;
  success = how == Ending::kSucceeded;
  reason = std::move(why);
}

std::vector<double> idle_between(const Outcome& outcome) {
  if (outcome.idle.empty()) return {};
  return {outcome.idle.begin() + 1, outcome.idle.end()};
}

Execution::Execution(const ControlSetup& setup, double step_duration, const OnEvent& on_event, std::stop_token stop)
    : setup_(setup),
      step_duration_(step_duration),
      on_event_(on_event),
      stop_(std::move(stop)),
      start_(Clock::now()),
      deadline_(start_ + setup.limits.timeout),
      still_since_(start_) {}

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
  outcome_.dropped = dropped_in(x_);
  return {};
}

std::vector<std::string> Execution::dropped_in(const State& x) const {
  std::vector<std::string> names;
  for (const int i : physics_pool::dropped_objects(setup_.geometry, x, setup_.objective.value("drop", "height"))) {
    names.push_back(layout().objects[static_cast<std::size_t>(i)].name);
  }
  return names;
}

bool Execution::is_over(int max_actions) {
  judge(x_, max_actions, outcome_);
  return outcome_.is_over();
}

bool Execution::will_be_over(const State& x, int max_actions) const {
  Outcome then;
  then.actions = outcome_.actions + 1;
  then.dropped = dropped_in(x);
  judge(x, max_actions, then);
  return then.is_over();
}

void Execution::judge(const State& x, int max_actions, Outcome& outcome) const {
  const physics_pool::TaskGeometry& geometry = setup_.geometry;
  if (!outcome.dropped.empty()) {
    outcome.conclude(Ending::kFailed, fmt::format("dropped {}", fmt::join(outcome.dropped, ", ")));
  } else if (const std::string failure = geometry.kind->failure(geometry, x); !failure.empty()) {
    outcome.conclude(Ending::kFailed, failure);
  } else if (physics_pool::at_goal(geometry, x, setup_.objective)) {
    outcome.conclude(Ending::kSucceeded, geometry.kind->achieved);
  } else if (outcome.actions >= max_actions) {
    outcome.conclude(Ending::kFailed, fmt::format("not there after {} actions", outcome.actions));
  }
}

Result<void> Execution::plan(const PlanRequest& request) {
  notify(Phase::kPlanning);
  const auto before = Clock::now();
  PlanOrigin origin{.while_acting = false, .deviation = deviation_of_ahead()};
  const bool is_near = origin.deviation && *origin.deviation <= setup_.plan_while_acting;
  const bool taken = is_near && take_ahead(origin);
  drop_ahead();
  auto ok = taken ? Result<void>() : plan_anew(request, origin);
  outcome_.planning_time += Clock::now() - before;
  if (ok && !std::exchange(planned_, true)) {
    outcome_.first_plan = plan_;
    outcome_.plan_time = outcome_.planning_time;
  }
  return ok;
}

Result<void> Execution::plan_anew(const PlanRequest& request, PlanOrigin origin) {
  if (rollouts_left() == 0) {
    is_out_of_rollouts_ = true;
    return Error{Code::kDeadline, "task: out of rollouts"};
  }
  auto problem_result = filled(blank_problem(), setup_, x_, request);
  if (!problem_result) return problem_result.error();
  std::uint64_t asked_for = 0;
  problem_result->rollouts_asked_for = &asked_for;
  auto plan_result = setup_.planner.plan(*problem_result, deadline_, stop_);
  if (!plan_result) {
    outcome_.rollouts += asked_for;
    return plan_result.error();
  }
  adopt(*problem_result, std::move(plan_result).value(), origin);
  return {};
}

// What does not depend on where a plan starts.
Problem Execution::blank_problem() const {
  return {.world = setup_.world,
          .rollouts = rollouts_left(),
          .seed = setup_.seed,
          .stream = stream_,
          // From the first action on a robot stands still for as long as this takes.
          .priority = outcome_.actions > 0 ? physics_pool::Priority::kUrgent : physics_pool::Priority::kNormal};
}

Result<Problem> Execution::filled(Problem blank, const ControlSetup& setup, const State& x,
                                  const PlanRequest& request) {
  auto start_result = setup.make_feasible ? setup.make_feasible(x) : Result<State>(x);
  if (!start_result) return start_result.error();
  blank.x0 = std::move(start_result).value();
  blank.initial = request.initial;
  blank.u_before = request.u_before;
  blank.iterations = request.iterations;
  blank.objective = request.objective;
  blank.weigh_robustness = request.weigh_robustness;
  return blank;
}

void Execution::adopt(const Problem& problem, Plan plan, const PlanOrigin& origin) {
  plan_ = std::move(plan);
  acted_at_plan_ = outcome_.actions;
  stream_ += static_cast<std::uint32_t>(problem.iterations);
  outcome_.rollouts += plan_.rollouts;
  outcome_.iterations += plan_.iterations;
  if (setup_.on_plan) setup_.on_plan(problem, plan_, origin);
}

std::optional<double> Execution::deviation_of_ahead() const {
  if (!ahead_) return {};
  return physics_pool::state_distance(setup_.geometry, x_.q, ahead_->predicted()->q);
}

// One that could not be made, for whatever reason, is made anew.
bool Execution::take_ahead(PlanOrigin& origin) {
  auto plan_result = ahead_->take();
  if (!plan_result) return false;
  origin.while_acting = true;
  ++outcome_.taken_ahead;
  adopt(*ahead_->problem(), std::move(plan_result).value(), origin);
  ahead_.reset();
  return true;
}

void Execution::drop_ahead() {
  if (!ahead_) return;
  ahead_->give_up();
  outcome_.abandoned_rollouts += ahead_->rollouts();
  ahead_.reset();
}

void Execution::plan_ahead(double rest, const NextRequest& next) {
  if (setup_.plan_while_acting <= 0 || !setup_.predict || !next || rollouts_left() == 0) return;
  Plan left = plan_;
  left.controls.drop_first();
  left.states.erase(left.states.begin());
  ActionAhead action{.x = x_, .u = plan_.controls, .duration = step_duration_, .rest = rest};
  action.u.truncate(1);
  Problem blank = blank_problem();
  blank.priority = physics_pool::Priority::kUrgent;
  ahead_ = std::make_unique<PlanAhead>(
      PlanAhead::Steps{
          .predict = [this, action = std::move(action)](std::stop_token stop) -> Result<State> {
            ActionAhead feasible = action;
            if (setup_.make_feasible) {
              auto start_result = setup_.make_feasible(action.x);
              if (!start_result) return start_result.error();
              feasible.x = std::move(start_result).value();
            }
            return setup_.predict(feasible, deadline_, std::move(stop));
          },
          .ask = [this, next, left = std::move(left),
                  blank = std::move(blank)](const State& x) -> Result<std::optional<Problem>> {
            const std::optional<PlanRequest> request = next(x, left);
            if (!request) return std::optional<Problem>();
            auto problem_result = filled(blank, setup_, x, *request);
            if (!problem_result) return problem_result.error();
            return std::optional(std::move(problem_result).value());
          },
          .plan = [this](const Problem& problem,
                         std::stop_token stop) { return setup_.planner.plan(problem, deadline_, std::move(stop)); }},
      stop_);
}

Result<void> Execution::act(double rest, const NextRequest& next) {
  drop_ahead();
  if (Clock::now() >= deadline_) return Error{Code::kDeadline, "task: out of time"};
  still_ += Clock::now() - still_since_;
  outcome_.idle.push_back(std::exchange(still_, {}).count());
  notify(Phase::kActing);
  if (auto ok = setup_.robot.start(plan_.controls.step(0), step_duration_, stop_); !ok) return ok;
  plan_ahead(rest, next);
  auto ok = setup_.robot.wait(stop_);
  still_since_ = Clock::now();
  if (ahead_) {
    ahead_->wait_until_asked();
    if (ahead_->predicted()) ++outcome_.rollouts;
    if (ahead_->problem()) {
      ++outcome_.plans_ahead;
    } else {
      ahead_.reset();
    }
  }
  if (!ok) return ok;
  ++outcome_.actions;
  plan_.controls.drop_first();
  plan_.states.erase(plan_.states.begin());
  ok = observe();
  if (!ok || rest <= 0) return ok;
  const std::vector<double> none(static_cast<std::size_t>(layout().nu), 0.0);
  return perform(none, rest);
}

Result<void> Execution::move(std::span<const double> u, Phase phase) {
  notify(phase);
  return perform(u, step_duration_);
}

// A motion that is no action of a plan, and what it came to.
Result<void> Execution::perform(std::span<const double> u, double duration) {
  still_ += Clock::now() - still_since_;
  auto ok = setup_.robot.execute(u, duration, stop_);
  still_since_ = Clock::now();
  return ok ? observe() : ok;
}

Result<Outcome> Execution::end(const Result<void>& ended) {
  drop_ahead();
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
