#pragma once
/// \file
/// Guard: a robot that refuses what would do harm, around any robot.

#include <array>
#include <chrono>
#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "robot_bridge/api/robot.hpp"

namespace jostle::robot_bridge {

/// An axis as a guard sees it.
struct GuardedAxis {
  double limit = 0.0;   ///< largest speed, m/s or rad/s
  double change = 0.0;  ///< how much a control may differ from the one before it, m/s or rad/s; 0: by any
  std::vector<std::pair<std::size_t, double>> joints;  ///< what it moves: a joint, and its speed per speed of the axis
};

struct GuardOptions {
  std::vector<GuardedAxis> axes;
  /// How far each joint may be from all places between the action's begin and where its control may have brought it,
  /// m or rad. A joint that lags behind is well: something is in its way.
  std::vector<double> stray;
  /// An action whose robot shows no newer state for so long, by the wall clock, is ended.
  std::chrono::milliseconds silence{200};
  /// Says what the first place of a path [n][joints] that is bad would touch; nothing if all are free. May be empty.
  std::function<std::optional<std::string>(std::span<const std::vector<double>> path)> touches;
  /// Is told, once the robot stands, why it was stopped, with the last states and commands. May be empty.
  std::function<void(const std::string& report)> tell;
};

/// A Guard passes on what a robot may do, watches it meanwhile, and stops it when something is wrong.
///
/// Before an action: its control is finite, of the right size, within the limits of the axes and not too different from
/// the one before it (a robot that has rested for 0.1 s of its clock was at 0); the way that it leads touches nothing.
/// During an action: states are finite and follow each other; no joint is where it was not told to go; the measured
/// place touches nothing.
///
/// Failure  the robot is stopped first, then the error is reported, with the last states and commands (the habit of
///          libfranka).
/// Errors   kInvalidArgument  a control that is refused; the robot did not move
///          kUnavailable      an action that was ended; says why
class Guard final : public Robot {
 public:
  static constexpr std::size_t kKept = 40;  ///< states of the report

  /// `robot` outlives it.
  Guard(Robot& robot, GuardOptions options);

  Result<RobotReading> read(std::stop_token stop = {}) override;
  Result<void> start(std::span<const double> u, double duration, std::stop_token stop = {}) override;
  Result<bool> advance(std::stop_token stop = {}) override;

  /// Returns the last states and the commands that were at work then, a line each, oldest first.
  std::string history() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Record {
    double stamp = 0.0;  // s of the robot
    std::vector<double> q, v, u;
  };

  Result<void> check_change(std::span<const double> u, double stamp) const;
  Result<void> check_way(const RobotReading& from, std::span<const double> u, double duration) const;
  Result<void> check_state(const RobotReading& reading);
  std::vector<double> joint_speeds(std::span<const double> u, std::size_t joints) const;
  void remember(const RobotReading& reading);
  Error end(Error why);

  Robot& robot_;
  const GuardOptions options_;
  const std::vector<double> limits_;
  bool acts_ = false;
  std::vector<double> u_;       // of the action at work, or of the last one
  double over_ = -1.0;          // s, when that one was over; below 0: none was
  RobotReading begin_;          // where the action at work began
  std::vector<double> speeds_;  // of the joints, as it tells them
  double duration_ = 0.0;       // s
  double stamp_ = 0.0;          // s, of the newest state
  Clock::time_point newest_{};  // when that came
  std::array<Record, kKept> kept_;
  std::size_t count_ = 0;  // states ever kept
};

}  // namespace jostle::robot_bridge
