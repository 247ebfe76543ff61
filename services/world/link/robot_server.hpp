#pragma once
/// \file
/// A robot that obeys over DDS: the server's half of the link.

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "robot_bridge/api/robot.hpp"
#include "services/common/process/trouble.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"

namespace jostle::world {

/// A Body is what a RobotServer moves: a simulated world, or an arm. One thread.
///
/// Errors   kInternal: it cannot go on, and the server ends; all others end the motion at work, and are told to its
///          commander.
class Body {
 public:
  virtual ~Body() = default;

  /// Returns scene_hash() of the scene that it simulates, as text; nothing of a real world.
  virtual std::string scene() const { return {}; }

  /// Returns the largest speeds of the axes, m/s or rad/s.
  virtual std::vector<double> limits() const = 0;

  /// Starts to apply u (m/s, rad/s) for `duration` s.
  virtual Result<void> begin(std::span<const double> u, double duration) = 0;
  /// Whether the motion's time is over.
  virtual bool is_over() const = 0;
  /// Lets a little time go by, some milliseconds at most.
  virtual Result<void> advance() = 0;
  /// Ends the motion here and now; the robot stands still.
  virtual void halt() = 0;

  /// No motion is at work: lets a little time go by, or returns false where it stands still, or needs nobody to go by.
  virtual Result<bool> rest() = 0;

  /// Returns how long its commander may be silent while a motion is at work, before the motion is ended; nothing where
  /// the body can do no harm. Commanders repeat a command each time they hear that it is at work.
  virtual std::optional<std::chrono::milliseconds> patience() const { return {}; }
  /// Returns the time between two statuses, by the wall clock.
  virtual std::chrono::milliseconds period() const { return std::chrono::milliseconds(50); }

  /// Returns the newest; the last good one where there is none.
  virtual robot_bridge::RobotReading reading() = 0;
  /// Publishes what it knows beyond that.
  virtual void publish() = 0;
};

/// Executes velocity commands one after the other, and publishes statuses.
///
/// It obeys one commander at a time: a participant, and an epoch of its choice that means one
/// task. Nobody else is obeyed as long as the middleware hears the commander; then the first
/// good command is, and a newcomer that comes sooner waits for some seconds. A commander's new
/// epoch ends its old one for good. Commands carry a sequence number; one that is done already is
/// counted and dropped, a bad one of the commander is refused in `RobotStatus.error`.
/// A stop (messages.hpp) ends the command at work at once. So does, where the body can do harm, a commander's silence,
/// and whatever it says that it should not: a command that is bad, out of order, or of another epoch, which is not
/// obeyed either. Everything else waits for its turn. The robot stands still when no command is at work.
class RobotServer {
 public:
  RobotServer(const wire::Participant& participant, Body& body);

  /// Runs until a stop is requested. Error kInternal of the body; it is also published.
  Result<void> run(std::stop_token stop);

 private:
  struct Action {
    std::uint64_t epoch = 0, sequence_number = 0;
    std::vector<double> u;
    double duration = 0.0;  // s
  };

  using Letter = wire::Inbox<jostle_msgs::msg::VelocityCommand>::Letter;
  /// Somebody who would command, and waits until nobody does.
  struct Newcomer {
    Letter letter;
    std::chrono::steady_clock::time_point since;
  };

  void receive();
  std::optional<Error> interrupted(const Action& action);
  std::optional<std::string> harm_of(const jostle_msgs::msg::VelocityCommand& command, const Action& action) const;
  bool may_command(const Letter& letter) const;
  void make_wait(Letter letter);
  void accept(Letter letter);
  void obey(const jostle_msgs::msg::VelocityCommand& command);
  bool begin(const jostle_msgs::msg::VelocityCommand& command, std::uint64_t writer);
  void say_troubles();
  Result<void> act(const Action& action, std::stop_token stop);
  Result<void> move(const Action& action, std::stop_token stop);
  Result<void> rest(std::stop_token stop);
  void publish();
  void publish_when_due();

  Body& body_;
  const std::string scene_;           // see Body
  const std::vector<double> limits_;  // largest speeds of the axes, m/s or rad/s
  std::deque<Letter> waiting_;        // the commander's, came while an action was at work
  std::deque<Newcomer> newcomers_;    // the newest command of each
  std::deque<Action> actions_;
  std::optional<std::uint64_t> commander_;  // its participant
  std::uint64_t epoch_ = 0;                 // of the commander
  std::deque<std::uint64_t> past_epochs_;   // that have ended
  std::uint64_t finished_ = 0;              // the commander's last finished, stopped or refused command
  std::uint64_t accepted_ = 0;              // its last accepted command
  common::Trouble stale_{"stale commands"};
  common::Trouble refused_{"refused commands"};
  common::Trouble foreign_{"commands of others"};
  bool busy_ = false;
  std::optional<Error> error_;  // of the newest command; nothing while all is well
  std::chrono::steady_clock::time_point next_publication_;
  std::chrono::steady_clock::time_point heard_;  // the commander, while a motion is at work

  wire::Writer<jostle_msgs::msg::RobotStatus> status_;
  wire::Inbox<jostle_msgs::msg::VelocityCommand> commands_;
};

}  // namespace jostle::world
