#include "services/world/link/world_client.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include "robot_bridge/safety/command_check.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

using std::chrono::steady_clock;

constexpr std::size_t kQueue = 64;  // a few seconds of states

// Later runs have larger epochs, so a world can tell an old commander's
// command from a new one's.
std::uint64_t epoch_now() {
  return static_cast<std::uint64_t>(std::chrono::system_clock::now().time_since_epoch().count());
}

Error silent(const char* who, const std::string& topic, std::chrono::milliseconds time, bool heard) {
  return {Code::kUnavailable,
          heard ? fmt::format("{}: nothing heard on {} for {:.1f} s; the process ended or is stalled", who, topic,
                              time.count() / 1e3)
                : fmt::format("{}: nobody publishes {} ({:.1f} s waited); start one with `jostle sim SCENE` "
                              "on the same ROS_DOMAIN_ID",
                              who, topic, time.count() / 1e3)};
}

}  // namespace

RobotClient::RobotClient(const wire::Participant& participant, const WorldClientOptions& options)
    : options_(options),
      status_(participant, wire::topics::kRobotStatus, kQueue),
      command_(participant, wire::topics::kRobotCommand),
      epoch_(epoch_now()) {}

Result<jostle_msgs::msg::RobotStatus> RobotClient::next_status(std::stop_token stop) {
  const auto patience = heard_ ? options_.silence : options_.start;
  const auto deadline = steady_clock::now() + patience;
  std::string problem;
  for (;;) {
    auto status = status_.take(deadline, stop);
    if (stop.stop_requested()) return Error{Code::kCancelled, "robot: stopped on request"};
    if (!status) {
      if (problem.empty()) return silent("robot", wire::topics::kRobotStatus.name, patience, heard_);
      return Error{Code::kInvalidArgument, problem + "; no good status followed"};
    }
    if (auto reading_result = from_message(*status); !reading_result) {
      problem = wire::topics::kRobotStatus.name + ": " + reading_result.error().message;
      spdlog::warn("{}; status {} rejected", problem, ++rejected_);
      continue;
    }
    if (sequence_number_ > 0 && status->epoch() > epoch_) {
      return Error{Code::kUnavailable, fmt::format("robot: another commander took over: its epoch is {}, ours {}",
                                                   status->epoch(), epoch_)};
    }
    if (known_ && status->epoch() < epoch_) {
      return Error{Code::kUnavailable, "robot: the world was started anew and knows nothing of this task"};
    }
    known_ = known_ || status->epoch() == epoch_;
    heard_ = true;
    limits_ = status->limits();
    time_ = seconds(status->header());
    return *std::move(status);
  }
}

Result<robot_bridge::RobotReading> RobotClient::read() {
  status_.take_all();  // yesterday's news
  for (;;) {
    auto status_result = next_status({});
    if (!status_result) return status_result.error();
    const bool current = sequence_number_ == 0 ||
                         (status_result->epoch() == epoch_ && status_result->sequence_number() == sequence_number_);
    if (!current || status_result->busy()) continue;
    return from_message(*status_result);
  }
}

Result<void> RobotClient::wait_for_robot(std::stop_token stop) {
  const auto deadline = steady_clock::now() + options_.start;
  // Statuses come many times a second; each may be of another, newer robot.
  while (!heard_ || !command_.reaches(*status_.last_writer())) {
    if (steady_clock::now() >= deadline) {
      return Error{Code::kUnavailable, fmt::format("robot: who publishes {} does not read {} ({:.1f} s waited)",
                                                   wire::topics::kRobotStatus.name, wire::topics::kRobotCommand.name,
                                                   static_cast<double>(options_.start.count()) / 1e3)};
    }
    if (auto status_result = next_status(stop); !status_result) return status_result.error();
  }
  return {};
}

Result<void> RobotClient::wait_until_finished(std::stop_token stop) {
  for (;;) {
    auto status_result = next_status(stop);
    if (!status_result) return status_result.error();
    if (status_result->epoch() != epoch_) continue;
    const bool finished = status_result->sequence_number() >= sequence_number_;
    const std::string& error = status_result->error();
    if (error.empty() || (!finished && error == refusal_)) {  // or an earlier command's
      if (finished) return {};
      continue;
    }
    refusal_ = error;
    return Error{Code::kInvalidArgument, "robot: " + error};
  }
}

Result<void> RobotClient::halt() {
  const auto deadline = steady_clock::now() + options_.silence;
  if (command_.write(stop_message(epoch_, ++sequence_number_))) {
    while (steady_clock::now() < deadline) {
      auto status_result = next_status({});
      if (!status_result) return status_result.error();
      const bool obeyed = status_result->epoch() == epoch_ && status_result->sequence_number() >= sequence_number_;
      if (obeyed && !status_result->busy()) return {};
    }
  }
  return Error{Code::kUnavailable, fmt::format("robot: told to stop, and not heard to stand still within {:.1f} s",
                                               static_cast<double>(options_.silence.count()) / 1e3)};
}

Result<void> RobotClient::execute(std::span<const double> u, double duration, std::stop_token stop) {
  if (auto ok = wait_for_robot(stop); !ok) return ok;
  // Here already: a robot says nothing of a newcomer's bad command.
  if (auto ok = robot_bridge::check_command(u, limits_, duration); !ok) return ok;
  if (stop.stop_requested()) return Error{Code::kCancelled, "robot: stopped before it moved"};
  jostle_msgs::msg::VelocityCommand command;
  command.header(make_header(time_));
  command.epoch(epoch_);
  command.sequence_number(++sequence_number_);
  command.velocities().assign(u.begin(), u.end());
  command.duration(duration);
  if (!command_.write(command)) {
    return Error{Code::kUnavailable, "robot: the middleware took no command on " + wire::topics::kRobotCommand.name};
  }
  auto ok = wait_until_finished(stop);
  if (ok || ok.error().code != Code::kCancelled) return ok;
  if (auto halted = halt(); !halted) return halted;
  return ok;
}

ObjectsClient::ObjectsClient(const wire::Participant& participant, const RobotClient& robot,
                             const WorldClientOptions& options)
    : robot_(robot), options_(options), states_(participant, wire::topics::kObjectStates, kQueue) {}

Result<std::vector<perception::ObjectReading>> ObjectsClient::read() {
  const auto patience = time_ < 0 ? options_.start : options_.silence;
  const auto deadline = steady_clock::now() + patience;
  std::string problem;
  constexpr double kSameTime = 1e-6;  // s, rounding of stamps
  while (newest_.empty() || time_ < robot_.time() - kSameTime) {
    auto message = states_.take(deadline);
    if (!message) {
      if (problem.empty()) return silent("objects", wire::topics::kObjectStates.name, patience, time_ >= 0);
      return Error{Code::kInvalidArgument, problem + "; no good measurement followed"};
    }
    auto readings_result = from_message(*message);
    if (readings_result) {
      newest_ = std::move(readings_result).value();
      time_ = seconds(message->header());
    } else {
      ++rejected_;
      problem = wire::topics::kObjectStates.name + ": " + readings_result.error().message;
      spdlog::warn("{}; measurement {} rejected", problem, rejected_);
    }
  }
  return newest_;
}

}  // namespace jostle::world
