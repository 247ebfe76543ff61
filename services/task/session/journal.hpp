#pragma once
/// \file
/// Journal: what a controller saw and decided, as it happened.

#include <functional>
#include <string>

#include "idl/msg/task.h"
#include "perception/api/object_source.hpp"
#include "planners/execution/execution.hpp"
#include "robot_bridge/api/robot.hpp"

namespace jostle::task {

/// A Journal stands between a controller and its two ports, and tells what passes. Neither
/// the controller nor the ports notice. Of plans it is told.
///
/// An observation is told of once its objects were read, a plan once it was taken up;
/// both carry a number that counts up from 0, so that whoever misses one knows.
///
/// Threads  the controller's; listeners are called on it.
class Journal {
 public:
  struct Listener {
    std::function<void(const jostle_msgs::msg::Observation&)> on_observation;
    std::function<void(const jostle_msgs::msg::Plan&)> on_plan;
  };

  /// `time`: gives the world's time, s, at which the newest robot reading was taken.
  Journal(std::string goal_id, double step_duration, std::function<double()> time, Listener listener);

  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  // The ports to give to the controller; the real ones behind them outlive it.
  class Robot;
  class Objects;

  /// To be called for every plan that a controller takes up, after the observation that it acts upon.
  void planned(const planners::Problem& problem, const planners::Plan& plan, const planners::PlanOrigin& origin);
  /// To be called when an action begins: how long the robot stood still before it, s.
  void idled(double seconds) { idle_ = seconds; }

 private:
  void saw(const std::vector<perception::ObjectReading>& objects);

  const std::string goal_id_;
  const double step_duration_;  // s
  const std::function<double()> time_;
  const Listener listener_;
  std::uint32_t observations_ = 0, plans_ = 0;
  std::vector<double> command_;  // since the last observation
  double duration_ = 0.0;        // s
  double idle_ = 0.0;            // s
  robot_bridge::RobotReading reading_;
};

class Journal::Robot final : public robot_bridge::Robot {
 public:
  Robot(Journal& journal, robot_bridge::Robot& robot) : journal_(journal), robot_(robot) {}
  Result<robot_bridge::RobotReading> read(std::stop_token stop = {}) override;
  Result<void> start(std::span<const double> u, double duration, std::stop_token stop = {}) override;
  Result<bool> advance(std::stop_token stop = {}) override;

 private:
  Journal& journal_;
  robot_bridge::Robot& robot_;
  std::vector<double> command_;  // of the action at work; empty: none is
  double duration_ = 0.0;        // s
};

class Journal::Objects final : public perception::ObjectSource {
 public:
  Objects(Journal& journal, perception::ObjectSource& objects) : journal_(journal), objects_(objects) {}
  Result<std::vector<perception::ObjectReading>> read() override;

 private:
  Journal& journal_;
  perception::ObjectSource& objects_;
};

}  // namespace jostle::task
