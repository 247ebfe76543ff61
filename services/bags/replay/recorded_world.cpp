#include "services/bags/replay/recorded_world.hpp"

#include <utility>

#include "robot_bridge/safety/command_check.hpp"
#include "services/common/process/program.hpp"

namespace jostle::bags {

RecordedWorld::RecordedWorld(const RecordedRun& run, std::vector<double> limits, double rate)
    : run_(run), limits_(std::move(limits)), rate_(rate), start_(std::chrono::steady_clock::now()) {}

double RecordedWorld::time() const { return world::seconds(run_.observations[at_].header()); }

Result<world::Seen> RecordedWorld::seen() const { return world::from_message(run_.observations[at_]); }

Result<void> RecordedWorld::start(std::span<const double> u, double duration, const std::stop_token& stop) {
  if (acts_) return robot_bridge::action_at_work();
  if (stop.stop_requested()) return Error{Code::kCancelled, "stopped on request"};
  if (at_ + 1 == run_.observations.size()) {
    over_ = true;
    return Error{Code::kCancelled, "the recording ends here"};
  }
  if (auto ok = robot_bridge::check_command(u, limits_, duration); !ok) return ok;
  acts_ = true;
  return {};
}

// The observation that was made after the action is the present one from the action's begin.
Result<bool> RecordedWorld::advance(std::stop_token stop) {
  if (!std::exchange(acts_, false)) return true;
  if (stop.stop_requested()) return Error{Code::kCancelled, "stopped on request"};
  ++at_;
  if (rate_ <= 0) return true;
  const std::chrono::duration<double> since(static_cast<double>(run_.observed[at_] - run_.observed[0]) * 1e-9 / rate_);
  if (common::pause_until(start_ + std::chrono::duration_cast<std::chrono::nanoseconds>(since), std::move(stop)))
    return true;
  return Error{Code::kCancelled, "stopped on request"};
}

Result<robot_bridge::RobotReading> RecordedWorld::Robot::read(std::stop_token stop) {
  if (stop.stop_requested()) return Error{Code::kCancelled, "stopped on request"};
  auto seen_result = world_.seen();
  if (!seen_result) return seen_result.error();
  return std::move(seen_result->robot);
}

Result<void> RecordedWorld::Robot::start(std::span<const double> u, double duration, std::stop_token stop) {
  return world_.start(u, duration, stop);
}

Result<bool> RecordedWorld::Robot::advance(std::stop_token stop) { return world_.advance(std::move(stop)); }

Result<std::vector<perception::ObjectReading>> RecordedWorld::Objects::read() {
  auto seen_result = world_.seen();
  if (!seen_result) return seen_result.error();
  return std::move(seen_result->objects);
}

}  // namespace jostle::bags
