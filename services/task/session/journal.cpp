#include "services/task/session/journal.hpp"

#include "services/world/link/messages.hpp"

namespace jostle::task {
Journal::Journal(std::string goal_id, double step_duration, std::function<double()> time, Listener listener)
    : goal_id_(std::move(goal_id)),
      step_duration_(step_duration),
      time_(std::move(time)),
      listener_(std::move(listener)) {}

void Journal::saw(const std::vector<perception::ObjectReading>& objects) {
  jostle_msgs::msg::Observation message = world::to_message({reading_, objects}, time_ ? time_() : 0.0);
  message.goal_id(goal_id_);
  message.number(observations_++);
  message.command(std::exchange(command_, {}));
  message.duration(std::exchange(duration_, 0.0));
  message.idle(std::exchange(idle_, 0.0));
  if (listener_.on_observation) listener_.on_observation(message);
}

void Journal::planned(const planners::Problem& problem, const planners::Plan& plan,
                      const planners::PlanOrigin& origin) {
  jostle_msgs::msg::Plan message;
  message.header(world::make_header(time_ ? time_() : 0.0));
  message.goal_id(goal_id_);
  message.number(plans_++);
  message.observation(observations_ - 1);
  message.q(problem.x0.q);
  message.v(problem.x0.v);
  message.nu(plan.controls.nu);
  message.step_duration(step_duration_);
  message.initial(problem.initial.values);
  message.iterations_allowed(problem.iterations);
  message.stream(problem.stream);
  message.clear_hand(problem.objective.weight("obstruction") > 0);
  message.controls(plan.controls.values);
  for (const State& x : plan.states) message.states().insert(message.states().end(), x.q.begin(), x.q.end());
  message.cost(plan.cost);
  message.at_goal(plan.at_goal);
  message.iterations(plan.iterations);
  message.rollouts(plan.rollouts);
  message.deviation(origin.deviation.value_or(-1.0));
  message.while_acting(origin.while_acting);
  if (listener_.on_plan) listener_.on_plan(message);
}

Result<robot_bridge::RobotReading> Journal::Robot::read(std::stop_token stop) {
  auto reading_result = robot_.read(std::move(stop));
  if (reading_result) journal_.reading_ = *reading_result;
  return reading_result;
}

Result<void> Journal::Robot::start(std::span<const double> u, double duration, std::stop_token stop) {
  auto ok = robot_.start(u, duration, std::move(stop));
  if (ok) {
    command_.assign(u.begin(), u.end());
    duration_ = duration;
  }
  return ok;
}

Result<bool> Journal::Robot::advance(std::stop_token stop) {
  auto over = robot_.advance(std::move(stop));
  if (over && !*over) return over;
  if (over && !command_.empty()) {
    journal_.command_ = command_;
    journal_.duration_ = duration_;
  }
  command_.clear();
  return over;
}

Result<std::vector<perception::ObjectReading>> Journal::Objects::read() {
  auto objects_result = objects_.read();
  if (objects_result) journal_.saw(*objects_result);
  return objects_result;
}

}  // namespace jostle::task
