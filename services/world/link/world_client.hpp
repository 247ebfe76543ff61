#pragma once
/// \file
/// A robot and its objects that live in another process: the two ports over DDS.

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "perception/api/object_source.hpp"
#include "robot_bridge/api/robot.hpp"
#include "services/common/process/trouble.hpp"
#include "services/wire/dds/participant.hpp"
#include "services/wire/dds/reader.hpp"
#include "services/wire/dds/topics.hpp"
#include "services/wire/dds/writer.hpp"

namespace jostle::world {

struct WorldClientOptions {
  /// A robot or a world that something waits for, and that is not heard for this long, is reported as gone. Shorter,
  /// and one that is only slow, on a machine whose workers take all cores, is taken for dead.
  std::chrono::milliseconds silence{5000};
  /// Grace for discovery before the first message.
  std::chrono::milliseconds start{5000};
  /// A robot that was told to stop and says nothing for so long is given up: whoever stops it waits.
  std::chrono::milliseconds stopping{1500};
};

/// Commands go to `rt/robot/command`; `rt/robot/status` tells when one is done. A stop
/// request is passed on, and answered with kCancelled once the robot says that it obeyed.
/// Bad statuses are counted, reported and skipped; only if nothing good follows
/// are they an error. The robot is the participant that speaks and reads our commands; what others say
/// of it is dropped and counted. As long as nobody who speaks reads them, such as a playback, it is waited for a robot
/// that does, for half of WorldClientOptions::start. That it obeys another commander, or does not take a command, is an
/// error, too.
class RobotClient final : public robot_bridge::Robot {
 public:
  RobotClient(const wire::Participant& participant, const WorldClientOptions& options = {});

  Result<robot_bridge::RobotReading> read(std::stop_token stop = {}) override;
  Result<void> start(std::span<const double> u, double duration, std::stop_token stop = {}) override;
  Result<bool> advance(std::stop_token stop = {}) override;

  /// Returns the time stamp of the newest status, s of the world's clock.
  double time() const { return time_; }

  /// Returns RobotStatus.scene of the newest status: empty before the first, and of a real world.
  const std::string& scene() const { return scene_; }

  /// Returns Participant::id() of the robot, once it was heard.
  std::optional<std::uint64_t> participant() const { return robot_; }

 private:
  /// Whether a status that this participant wrote is the robot's.
  bool is_robot(std::uint64_t writer);

  /// Waits for the next good status; see patience().
  Result<jostle_msgs::msg::RobotStatus> next_status(std::chrono::milliseconds patience, std::stop_token stop);
  std::chrono::milliseconds patience() const { return heard_ ? options_.silence : options_.start; }

  /// Waits until the sender of the statuses reads our commands. It does not count that others read them.
  Result<void> wait_for_robot(std::stop_token stop);

  /// Waits for one status more, and returns whether the command at work is finished.
  Result<bool> hear_of(const jostle_msgs::msg::VelocityCommand& command, std::stop_token stop);
  void repeat_if_at_work(const jostle_msgs::msg::RobotStatus& status);
  Error not_taken(const jostle_msgs::msg::RobotStatus& status) const;

  /// Makes the robot stand still. Error kUnavailable: it does not say that it does.
  Result<void> halt();

  WorldClientOptions options_;
  wire::Inbox<jostle_msgs::msg::RobotStatus> status_;
  wire::Writer<jostle_msgs::msg::VelocityCommand> command_;
  const std::uint64_t epoch_;
  std::uint64_t sequence_number_ = 0;
  std::optional<jostle_msgs::msg::VelocityCommand> at_work_;
  std::chrono::steady_clock::time_point idle_since_{};  // the robot, while a command of ours should be at work
  std::string refusal_;                 // the last one heard; it is repeated until the next good command
  std::optional<std::uint64_t> robot_;  // its participant
  std::optional<std::chrono::steady_clock::time_point> strangers_since_;  // statuses of who does not read our commands
  bool heard_ = false;
  std::vector<double> limits_;  // per axis, of the newest status
  bool known_ = false;          // a status has named our epoch
  double time_ = 0.0;
  std::string scene_;
  common::Trouble rejected_{"bad statuses"};
  common::Trouble foreign_{"statuses of others"};
};

/// Reads object states from `rt/objects/states`, never older than the robot's newest
/// status, so that both describe one moment. Where the robot's participant speaks of objects,
/// as a simulated world does, nobody else is listened to. Bad measurements are counted,
/// reported and skipped; only if nothing good follows are they an error.
class ObjectsClient final : public perception::ObjectSource {
 public:
  ObjectsClient(const wire::Participant& participant, const RobotClient& robot, const WorldClientOptions& options = {});

  Result<std::vector<perception::ObjectReading>> read() override;

  /// Returns ObjectStates.scene of the newest measurement, as RobotClient::scene().
  const std::string& scene() const { return scene_; }

  std::uint64_t rejected() const { return rejected_.count(); }

 private:
  const RobotClient& robot_;
  WorldClientOptions options_;
  wire::Inbox<jostle_msgs::msg::ObjectStates> states_;
  std::vector<perception::ObjectReading> newest_;
  double time_ = -1.0;  // s, stamp of newest_; before the first: none
  std::string scene_;
  common::Trouble rejected_{"bad measurements"};
  common::Trouble foreign_{"measurements of others"};
};

}  // namespace jostle::world
