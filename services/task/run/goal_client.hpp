#pragma once
/// \file
/// The asker's side of a task: a goal goes out, feedback and one result come back.

#include <chrono>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"

namespace jostle::task {

/// A GoalClient asks the coordinator of a domain to perform one goal. Once it has been asked, nobody else is believed.
///
/// Threads  one.
class GoalClient {
 public:
  using Clock = std::chrono::steady_clock;
  /// A coordinator takes a goal up, and sends its result, within moments.
  static constexpr std::chrono::seconds kIdlePatience{10};

  struct Listener {
    std::function<void(const jostle_msgs::msg::Feedback&)> on_feedback;  ///< of this goal; may be empty
    std::function<void(const std::string&)> on_notice;                   ///< the coordinator's trouble; may be empty
  };

  /// `goal_id`: unique among all goals of the domain.
  GoalClient(const wire::Participant& participant, std::string goal_id, Listener listener);

  const std::string& goal_id() const { return goal_id_; }

  /// Takes what has come since the last call.
  void listen();

  /// When a coordinator, or a world, was heard last.
  std::optional<Clock::time_point> coordinator_heard() const { return coordinator_heard_; }
  std::optional<Clock::time_point> world_heard() const { return world_heard_; }
  /// Returns of which scene the world is that was heard last (RobotStatus.scene); empty: a real one, or none.
  const std::string& world_scene() const { return world_scene_; }
  /// When a coordinator was heard last that works for somebody else.
  std::optional<Clock::time_point> others_heard() const { return others_heard_; }

  /// Returns the participants that take goals and give feedback, ascending; whoever does only one of them looks on.
  std::vector<std::uint64_t> coordinators() const;
  /// Whether a goal would reach the coordinator of this participant, and its result us.
  bool reaches(std::uint64_t coordinator) const;

  /// Sends the goal, whose id becomes goal_id(), to be performed by this participant. Returns whether the middleware
  /// took it.
  bool send(jostle_msgs::msg::Goal goal, std::uint64_t coordinator);
  bool is_sent() const { return sent_; }

  /// Whether the coordinator is, or was until a moment ago, at work on the goal, by its feedback.
  /// Errors   unavailable: it has been idle, done, or at work on something else for kIdlePatience and no result came;
  ///                       the goal was lost on its way there, or the result on its way back
  Result<void> check_at_work() const;

  /// Waits for the result of this goal; nothing if `deadline` or a stop comes first.
  std::optional<jostle_msgs::msg::GoalResult> wait(Clock::time_point deadline, std::stop_token stop);

  /// Asks the coordinator to end the task. What is lost on the way is not sent again.
  void cancel();

 private:
  void note_work(const jostle_msgs::msg::Feedback& feedback);

  const std::string goal_id_;
  const Listener listener_;
  bool sent_ = false;
  std::uint64_t coordinator_ = 0;  // its participant, once the goal was sent
  std::string trouble_;            // the coordinator's newest
  std::string world_scene_;
  std::optional<Clock::time_point> coordinator_heard_, world_heard_, others_heard_;
  std::optional<Clock::time_point> idle_since_;  // the coordinator, as far as this goal is concerned
  bool taken_up_ = false;                        // the coordinator spoke of the goal

  wire::Writer<jostle_msgs::msg::Goal> goal_;
  wire::Writer<jostle_msgs::msg::Cancel> cancel_;
  wire::Inbox<jostle_msgs::msg::Feedback> feedback_;
  wire::Inbox<jostle_msgs::msg::RobotStatus> world_;
  wire::Inbox<jostle_msgs::msg::GoalResult> results_;
};

}  // namespace jostle::task
