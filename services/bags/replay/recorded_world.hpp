#pragma once
/// \file
/// RecordedWorld: a robot and its objects that do again what they once did.

#include <chrono>
#include <span>
#include <stop_token>
#include <vector>

#include "perception/api/object_source.hpp"
#include "robot_bridge/api/robot.hpp"
#include "services/bags/recorded/recorded_run.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::bags {

/// Gives out one recorded observation after the other, whatever it is commanded: the next
/// one follows any command that a robot would take. After the last one, a command ends with kCancelled.
///
/// Threads  one.
class RecordedWorld {
 public:
  /// `limits`: largest speeds of the recorded robot's axes, m/s or rad/s. `rate`: recorded seconds per second; 0: as
  /// fast as it is asked. The run outlives it.
  RecordedWorld(const RecordedRun& run, std::vector<double> limits, double rate);

  class Robot;
  class Objects;

  double time() const;                           ///< when the present observation was made, s of the world's clock
  bool asked_for_more() const { return over_; }  ///< a command came after the last observation

 private:
  Result<world::Seen> seen() const;
  Result<void> start(std::span<const double> u, double duration, const std::stop_token& stop);
  Result<bool> advance(std::stop_token stop);

  const RecordedRun& run_;
  const std::vector<double> limits_;
  const double rate_;
  const std::chrono::steady_clock::time_point start_;
  std::size_t at_ = 0;  // the present observation
  bool over_ = false;
  bool acts_ = false;  // an action is at work
};

class RecordedWorld::Robot final : public robot_bridge::Robot {
 public:
  explicit Robot(RecordedWorld& world) : world_(world) {}
  Result<robot_bridge::RobotReading> read(std::stop_token stop = {}) override;
  Result<void> start(std::span<const double> u, double duration, std::stop_token stop = {}) override;
  Result<bool> advance(std::stop_token stop = {}) override;

 private:
  RecordedWorld& world_;
};

class RecordedWorld::Objects final : public perception::ObjectSource {
 public:
  explicit Objects(const RecordedWorld& world) : world_(world) {}
  Result<std::vector<perception::ObjectReading>> read() override;

 private:
  const RecordedWorld& world_;
};

}  // namespace jostle::bags
