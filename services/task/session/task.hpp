#pragma once
/// \file
/// Task: a goal as it came over the wire, made ready to be performed and recorded.

#include <functional>
#include <memory>
#include <stop_token>
#include <string>

#include "idl/msg/task.h"
#include "services/task/config/predictor.hpp"
#include "services/task/session/composition.hpp"
#include "services/task/session/journal.hpp"

namespace jostle::task {

/// Everything a goal's texts say, checked, and the run composed of it.
///
/// Threads  one.
/// Repeats  equal goals and equal observations make bit-equal decisions on any pool.
class Task {
 public:
  /// `on_split`: see Predictor::make.
  /// Errors   those of the goal's texts; the message names the field
  ///          those of Pool::load
  static Result<Task> prepare(const jostle_msgs::msg::Goal& goal, physics_pool::AsyncPool& pool,
                              std::function<void(const std::string&)> on_split = {});

  /// Who hears of a task.
  struct Watch {
    planners::OnEvent on_event;
    planners::OnProgress on_progress;
    Journal::Listener journal;
    std::function<double()> time;  ///< see Journal
  };

  /// Errors   those of the controllers
  Result<planners::Outcome> perform(robot_bridge::Robot& robot, perception::ObjectSource& objects, const Watch& watch,
                                    std::stop_token stop);

  const physics_pool::Scene& execution_scene() const { return execution_; }
  const physics_pool::TaskGeometry& geometry() const { return run_.geometry(); }  ///< that of the planning scene
  Parameters& parameters() { return run_.parameters(); }
  const Parameters& parameters() const { return run_.parameters(); }

 private:
  Task(std::string goal_id, physics_pool::Scene execution, Predictor predictor, Composition run);

  std::string goal_id_;
  physics_pool::Scene execution_;
  Predictor predictor_;  // what stands between the pool and the planner
  Composition run_;
};

/// Describes the run of a goal that is taken up now, by this build on this machine.
jostle_msgs::msg::TaskRun describe_run(const jostle_msgs::msg::Goal& goal);

}  // namespace jostle::task
