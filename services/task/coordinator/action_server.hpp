#pragma once
/// \file
/// The coordinator's goals as ROS 2 actions.

#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "physics_pool/scene/task_kind.hpp"
#include "services/wire/dds/action_topics.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/writer.hpp"

namespace jostle::task {

/// Serves an action of type jostle_msgs/action/Manipulate for each kind of task, /grasp and so on, as rclcpp's action
/// servers do: the services send_goal, get_result and cancel_goal, the topics feedback and status. It is a front: who
/// performs goals is told of them, and tells how they go.
///
/// One goal at a time: another one is rejected, and the log says why. A goal that cannot be performed is accepted, and
/// aborted with a result that says what is wrong with it, as ROS 2 has no words for a rejection. The last
/// kFinishedKept goals that have ended are remembered with their results.
///
/// Threads  safe from any thread; `Work` is called on a thread of its own.
class ActionServer {
 public:
  using Goal = jostle_msgs::msg::Goal;
  struct Work {
    std::function<bool()> is_free;                           ///< whether a goal would be taken up now
    std::function<bool(const Goal&)> begin;                  ///< false: it was not taken
    std::function<void(const std::string& goal_id)> cancel;  ///< of a goal that has begun, or will
  };
  static constexpr std::size_t kFinishedKept = 16;

  /// Throws SetupError.
  ActionServer(const wire::Participant& participant, Work work);
  ~ActionServer();

  /// Hears of any goal, by its id; those of others do not matter.
  void on_feedback(const jostle_msgs::msg::Feedback& feedback);
  void on_result(const jostle_msgs::msg::GoalResult& result);

 private:
  using Uuid = std::array<std::uint8_t, 16>;
  struct Action;
  // A goal of one of the actions.
  struct Held {
    Action* action = nullptr;
    Uuid uuid{};
    builtin_interfaces::msg::Time accepted;  // wall-clock time
    std::int8_t status = 0;
    jostle_msgs::msg::GoalResult result;
    std::deque<wire::Asker> askers;  // who waits for the result
  };
  // Something to do. Those of one participant may be so many.
  struct Event {
    std::uint64_t participant = 0;
    std::function<void()> run;
  };

  void post(std::uint64_t participant, std::function<void()> run);
  void work_off(std::stop_token stop);

  void send_goal(Action& action, jostle_msgs::action::Manipulate_SendGoal_Request& request, const wire::Asker& asker);
  void get_result(Action& action, const Uuid& uuid, const wire::Asker& asker);
  void cancel_goals(Action& action, const action_msgs::msg::GoalInfo& which, const wire::Asker& asker);
  void finish(Held& goal, const jostle_msgs::msg::GoalResult& result);
  void set_status(Held& goal, std::int8_t status);
  Held* find(const Action& action, const Uuid& uuid);
  Held* unfinished();

  const wire::Participant participant_;
  const Work work_;
  std::deque<Held> goals_;  // oldest first; the thread's
  std::mutex mutex_;        // guards events_
  std::condition_variable_any news_;
  std::deque<Event> events_;
  std::vector<std::unique_ptr<Action>> actions_;
  std::jthread thread_;
};

}  // namespace jostle::task
