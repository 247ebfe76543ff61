#pragma once
/// \file
/// Robot, ObjectSource and Planner without physics: hand or pusher moves exactly as
/// told, objects stand still, and tests step in where they like.

#include <functional>
#include <numeric>
#include <optional>
#include <utility>
#include <vector>

#include "perception/api/object_source.hpp"
#include "physics_pool/objective/terms.hpp"
#include "planners/api/planner.hpp"
#include "robot_bridge/api/robot.hpp"
#include "robot_bridge/safety/command_check.hpp"
#include "tests/support/planar.hpp"

namespace jostle::tests {

/// x after u for `duration` seconds if nothing resists.
inline State moved(State x, std::span<const double> u, double duration) {
  x.q[kJointX] += u[kControlX] * duration;
  x.q[kJointY] += u[kControlY] * duration;
  if (u.size() == kPusherControls) return x;
  x.q[kJointRotation] += u[kControlRotation] * duration;
  x.q[kJointLeft] += u[kControlOpening] * duration / 2;
  x.q[kJointRight] += u[kControlOpening] * duration / 2;
  return x;
}

class KinematicRobot final : public robot_bridge::Robot {
 public:
  explicit KinematicRobot(State& x, int joints = 5, int axes = kGripperControls)
      : x_(x), joints_(joints), limits_(static_cast<std::size_t>(axes), 2.0) {}

  Result<robot_bridge::RobotReading> read(std::stop_token stop = {}) override {
    if (read_error) return *read_error;
    if (stop.stop_requested()) return Error{Code::kCancelled, "robot: cancelled"};
    return robot_bridge::RobotReading{.stamp = std::accumulate(durations.begin(), durations.end(), 0.0),
                                      .q = {x_.q.begin(), x_.q.begin() + joints_},
                                      .v = std::vector<double>(static_cast<std::size_t>(joints_), 0.0),
                                      .object_in_hand = object_in_hand};
  }

  Result<void> start(std::span<const double> u, double duration, std::stop_token stop = {}) override {
    if (at_work_) return robot_bridge::action_at_work();
    if (execute_error) return *execute_error;
    if (auto ok = robot_bridge::check_command(u, limits_, duration); !ok) return ok;
    if (stop.stop_requested()) return Error{Code::kCancelled, "robot: cancelled"};
    at_work_.emplace(std::vector<double>(u.begin(), u.end()), duration);
    return {};
  }

  Result<bool> advance(std::stop_token stop = {}) override {
    if (!at_work_) return true;
    const auto [u, duration] = *std::exchange(at_work_, {});
    if (stop.stop_requested()) return Error{Code::kCancelled, "robot: cancelled"};
    executed.push_back(u);
    durations.push_back(duration);
    x_ = moved(x_, u, duration);
    if (after_execute) after_execute(x_, static_cast<int>(executed.size()));
    return true;
  }

  std::vector<std::vector<double>> executed;
  std::vector<double> durations;
  std::optional<bool> object_in_hand;
  std::optional<Error> read_error, execute_error;
  std::function<void(State&, int actions)> after_execute;

 private:
  State& x_;
  int joints_;
  std::vector<double> limits_;                                     // per axis
  std::optional<std::pair<std::vector<double>, double>> at_work_;  // u, s
};

class KinematicObjects final : public perception::ObjectSource {
 public:
  KinematicObjects(const StateLayout& layout, const State& x) : layout_(layout), x_(x) {}

  Result<std::vector<perception::ObjectReading>> read() override {
    if (error) return *error;
    std::vector<perception::ObjectReading> readings;
    // Last object first: the order must not matter.
    for (auto slot = layout_.objects.rbegin(); slot != layout_.objects.rend(); ++slot) {
      if (slot->name == hidden) continue;
      perception::ObjectReading reading{.name = slot->name};
      std::copy_n(x_.q.begin() + slot->q, 3, reading.position.begin());
      std::copy_n(x_.q.begin() + slot->q + 3, 4, reading.orientation.begin());
      std::copy_n(x_.v.begin() + slot->v, 3, reading.linear.begin());
      std::copy_n(x_.v.begin() + slot->v + 3, 3, reading.angular.begin());
      readings.push_back(reading);
    }
    return readings;
  }

  std::string hidden;
  std::optional<Error> error;

 private:
  const StateLayout& layout_;
  const State& x_;
};

/// Predicts the initial controls kinematically and improves nothing.
class KinematicPlanner final : public planners::Planner {
 public:
  Result<planners::Plan> plan(const planners::Problem& problem, planners::TimePoint deadline,
                              std::stop_token = {}) override {
    problems.push_back(problem);
    deadlines.push_back(deadline);
    if (error) {
      if (problem.rollouts_asked_for) *problem.rollouts_asked_for += rollouts_before_error;
      return *error;
    }
    planners::Plan plan;
    plan.controls = problem.initial;
    plan.states = {problem.x0};
    for (int t = 0; t < plan.controls.steps(); ++t) {
      plan.states.push_back(moved(plan.states.back(), plan.controls.step(t), step_duration));
    }
    plan.cost = 1.0;
    plan.at_goal = predicts_goal;
    plan.iterations = problem.iterations;
    plan.rollouts = 10;
    if (change) change(plan, static_cast<int>(problems.size()));
    return plan;
  }

  double step_duration = 1.0;
  bool predicts_goal = true;
  std::optional<Error> error;
  std::uint64_t rollouts_before_error = 0;
  std::function<void(planners::Plan&, int plans)> change;
  std::vector<planners::Problem> problems;
  std::vector<planners::TimePoint> deadlines;
};

}  // namespace jostle::tests
