#pragma once
/// \file
/// The execution world as a process of its own.

#include <chrono>
#include <cstdint>
#include <deque>
#include <optional>
#include <stop_token>
#include <string>

#include "physics_pool/local/execution_world.hpp"
#include "physics_pool/scene/scene.hpp"
#include "services/common/process/trouble.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"

namespace jostle::world {

struct SimulatedWorldOptions {
  physics_pool::VelocityNoise noise;
  /// The planner's scene. The objects' first measurement agrees with it, and all later ones keep its heights.
  physics_pool::Scene belief;
  /// World seconds per second while an action runs; 0 is as fast as possible.
  double rate = 0.0;
  /// Let the world go on between actions (the robot brakes and holds) instead
  /// of standing still, as in the thesis's simulation experiments.
  bool free_running = false;
};

/// Executes velocity commands one after the other and publishes joint states,
/// object states, poses and transforms: all of them measurements, not truth.
///
/// It obeys one commander at a time: a participant, and an epoch of its choice that means one
/// task. Nobody else is obeyed as long as the middleware hears the commander; then the first
/// good command is, and a newcomer that comes sooner waits for some seconds. A commander's new
/// epoch ends its old one for good. Commands carry a sequence number; one that is done already is
/// counted and dropped, a bad one of the commander is refused in `RobotStatus.error`.
/// A stop (messages.hpp) ends the command at work at once; everything else waits
/// for its turn. The robot stands still when no command is at work.
class SimulatedWorld {
 public:
  SimulatedWorld(const wire::Participant& participant, physics_pool::WorldPtr world,
                 const SimulatedWorldOptions& options);

  /// Runs until a stop is requested. Error kInternal if the physics diverged; it is
  /// also published.
  Result<void> run(std::stop_token stop);

 private:
  struct Action {
    std::uint64_t epoch = 0, sequence_number = 0;
    std::vector<double> u;
    long steps = 0;  // engine steps
  };

  using Letter = wire::Inbox<jostle_msgs::msg::VelocityCommand>::Letter;
  /// Somebody who would command, and waits until nobody does.
  struct Newcomer {
    Letter letter;
    std::chrono::steady_clock::time_point since;
  };

  void receive();
  bool told_to_stop();
  bool may_command(const Letter& letter) const;
  void make_wait(Letter letter);
  void accept(Letter letter);
  void obey(const jostle_msgs::msg::VelocityCommand& command);
  bool begin(const jostle_msgs::msg::VelocityCommand& command, std::uint64_t writer);
  void say_troubles();
  Result<void> act(const Action& action, std::stop_token stop);
  Result<void> rest(std::stop_token stop);
  void publish();
  void publish_when_due();

  SimulatedWorldOptions options_;
  physics_pool::ExecutionWorld world_;
  std::vector<double> limits_;      // largest speeds of the axes, m/s or rad/s
  std::vector<double> still_;       // the control that moves nothing
  std::deque<Letter> waiting_;      // the commander's, came while an action was at work
  std::deque<Newcomer> newcomers_;  // the newest command of each
  std::deque<Action> actions_;
  std::optional<std::uint64_t> commander_;  // its participant
  std::uint64_t epoch_ = 0;                 // of the commander
  std::deque<std::uint64_t> past_epochs_;   // that have ended
  std::uint64_t finished_ = 0;              // the commander's last finished, stopped or refused command
  std::uint64_t accepted_ = 0;              // its last accepted command
  common::Trouble stale_{"stale commands"};
  common::Trouble refused_{"refused commands"};
  common::Trouble foreign_{"commands of others"};
  bool moved_ = false;  // a command was begun
  bool busy_ = false;
  std::string error_;
  std::chrono::steady_clock::time_point next_publication_, next_transforms_;
  double transforms_time_ = -1.0;  // world time of the newest transforms, s

  wire::Writer<sensor_msgs::msg::JointState> joints_;
  wire::Writer<jostle_msgs::msg::ObjectStates> objects_;
  wire::Writer<geometry_msgs::msg::PoseArray> poses_;
  wire::Writer<tf2_msgs::msg::TFMessage> transforms_;
  wire::Writer<rosgraph_msgs::msg::Clock> clock_;
  wire::Writer<jostle_msgs::msg::RobotStatus> status_;
  wire::Inbox<jostle_msgs::msg::VelocityCommand> commands_;
};

}  // namespace jostle::world
