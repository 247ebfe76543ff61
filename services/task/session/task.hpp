#pragma once
/// \file
/// Task: a goal made ready to be performed, on any robot and with any pool.

#include <functional>
#include <memory>
#include <stop_token>
#include <string>

#include "idl/msg/task.h"
#include "physics_pool/local/world.hpp"
#include "planners/control/controller.hpp"
#include "services/task/config/parameters.hpp"
#include "services/task/config/predictor.hpp"
#include "services/task/session/journal.hpp"

namespace jostle::task {

/// Everything a goal's texts say, checked.
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

  /// Who hears of it.
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
  /// Of the planning scene.
  const physics_pool::TaskGeometry& geometry() const { return believed_->geometry(); }
  Parameters& parameters() { return parameters_; }

 private:
  Task(const jostle_msgs::msg::Goal& goal, physics_pool::Scene execution, physics_pool::WorldPtr believed,
       Parameters parameters, Predictor predictor, Hash world);

  std::string goal_id_;
  std::uint64_t seed_;
  physics_pool::Scene execution_;
  physics_pool::WorldPtr believed_;  // the planning scene
  Parameters parameters_;
  Predictor predictor_;  // what stands between the pool and the planner
  Hash world_;           // planning world, known to the predictor
};

/// A goal that is taken up now, by this build on this machine.
jostle_msgs::msg::TaskRun describe_run(const jostle_msgs::msg::Goal& goal);

}  // namespace jostle::task
