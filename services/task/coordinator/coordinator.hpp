#pragma once
/// \file
/// The coordinator: accepts a task, plans it with a pool, executes it, reports.

#include <atomic>
#include <functional>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "physics_pool/api/pool.hpp"
#include "services/task/coordinator/action_server.hpp"
#include "services/task/session/task.hpp"
#include "services/wire/dds/display_topics.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"
#include "services/world/link/world_client.hpp"

namespace jostle::task {

/// What keeps a task from making progress, as its parts say it. Threads: any.
class TroubleBoard {
 public:
  /// An empty text: it goes on.
  void post(const std::string& text) {
    const std::lock_guard lock(mutex_);
    text_ = text;
  }

  std::string text() const {
    const std::lock_guard lock(mutex_);
    return text_;
  }

 private:
  mutable std::mutex mutex_;  // guards text_
  std::string text_;
};

/// The coordinator performs one task at a time. A goal that arrives meanwhile is refused at once; a
/// cancelled task ends within a fraction of a second, the robot standing still. Goals come as messages, and as ROS 2
/// actions (ActionServer).
///
/// Feedback goes out several times a second whether there is news or not, so
/// that silence means death. What decides a task and what it decides goes out as
/// TaskRun, Observation and Plan: enough to make every decision again. Markers of the goal's scene and of the newest
/// plan go out for those who look.
class Coordinator {
 public:
  /// `troubles` is shown in the feedback as long as a task is there.
  Coordinator(const wire::Participant& participant, physics_pool::AsyncPool& pool, TroubleBoard& troubles);

  /// Runs until a stop is requested.
  void run(std::stop_token stop);

 private:
  using Goal = jostle_msgs::msg::Goal;

  // What the controller made of a task, however it ended.
  struct Performance {
    std::optional<planners::Outcome> outcome;         // none if the controller never began
    std::vector<jostle_msgs::msg::Observation> seen;  // as the journal was told; entry i became outcome->observed[i]
    Result<void> ended;
  };
  // What the actions ask for.
  ActionServer::Work work();
  void cancel(const std::string& goal_id);

  // The world of one goal, as the wire shows it.
  struct Link {
    explicit Link(const wire::Participant& participant) : robot(participant), objects(participant, robot) {}
    // Of which scene the world is that was heard; empty: a real one, or none was heard yet.
    const std::string& scene() const { return robot.scene().empty() ? objects.scene() : robot.scene(); }
    world::RobotClient robot;
    world::ObjectsClient objects;
  };
  Result<void> check_world(Link& link, const Hash& scene, std::stop_token stop);
  Performance perform(const Goal& goal, Task& task, Link& link, std::stop_token stop);
  // `is_action`: it came as one.
  void serve(const Goal& goal, bool is_action, std::stop_token stop);
  void answer(const jostle_msgs::msg::GoalResult& result, std::stop_token stop);
  void refuse_goals_meanwhile(std::stop_token stop);
  void publish_feedback(std::stop_token stop);
  void note(const planners::ControlEvent& event, const physics_pool::TaskGeometry& geometry);
  void note(const planners::Progress& progress, const physics_pool::TaskGeometry& geometry);

  const wire::Participant participant_;
  physics_pool::AsyncPool& pool_;
  TroubleBoard& troubles_;

  std::mutex mutex_;  // guards all down to cancel_
  jostle_msgs::msg::Feedback feedback_;
  std::chrono::steady_clock::time_point started_;
  std::uint64_t rollouts_before_ = 0;  // those of the plans before the present one
  std::string goal_id_;                // empty: no task
  double world_time_ = 0.0;            // s, of the newest observation
  std::stop_source cancel_;            // stops the present task

  wire::Writer<jostle_msgs::msg::Feedback> feedback_writer_;
  wire::Writer<jostle_msgs::msg::GoalResult> result_writer_;
  wire::Writer<jostle_msgs::msg::TaskRun> run_writer_;
  wire::Writer<jostle_msgs::msg::Observation> observation_writer_;
  wire::Writer<jostle_msgs::msg::Plan> plan_writer_;
  wire::Writer<visualization_msgs::msg::MarkerArray> scene_marker_writer_, plan_marker_writer_;
  wire::Writer<Goal> goal_writer_;  // of goals that come as actions
  wire::Inbox<Goal> goals_;
  wire::Reader<jostle_msgs::msg::Cancel> cancels_;
  ActionServer actions_;
};

}  // namespace jostle::task
