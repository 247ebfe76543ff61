#include "services/world/link/world_client.hpp"

#include <fmt/format.h>

#include "robot_bridge/safety/command_check.hpp"
#include "services/common/process/random_id.hpp"
#include "services/wire/limits.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

using std::chrono::steady_clock;

constexpr std::size_t kQueue = 64;  // a few seconds of states

Error silent(const char* who, const std::string& topic, std::chrono::milliseconds time, bool heard) {
  return {Code::kUnavailable,
          heard ? fmt::format("{}: nothing heard on {} for {:.1f} s; its process ended, is stalled or cut off (`jostle "
                              "doctor` checks the network)",
                              who, topic, time.count() / 1e3)
                : fmt::format("{}: nobody publishes {} ({:.1f} s waited); start one with `jostle sim SCENE` "
                              "on the same ROS_DOMAIN_ID",
                              who, topic, time.count() / 1e3)};
}

}  // namespace

RobotClient::RobotClient(const wire::Participant& participant, const WorldClientOptions& options)
    : options_(options),
      status_(participant, wire::topics::kRobotStatus, kQueue),
      command_(participant, wire::topics::kRobotCommand),
      epoch_(common::random_id()) {}

// The first that reads our commands, as long as it is there. Once it has a command it stays who it is: another robot
// does not know what this one has done.
bool RobotClient::is_robot(std::uint64_t writer) {
  const bool there = robot_ && status_.hears(*robot_);
  if (robot_ != writer && !there && sequence_number_ == 0 && command_.reaches(writer)) robot_ = writer;
  if (robot_) return robot_ == writer;
  // A playback speaks of a robot, and obeys nobody. It is believed if no robot is found beside it.
  if (!strangers_since_) strangers_since_ = steady_clock::now();
  return steady_clock::now() - *strangers_since_ > options_.start / 2;
}

Result<jostle_msgs::msg::RobotStatus> RobotClient::next_status(std::chrono::milliseconds patience,
                                                               std::stop_token stop) {
  const auto deadline = steady_clock::now() + patience;
  std::optional<Error> problem;
  const auto reject = [&](Error error) {
    problem = std::move(error);
    rejected_.warn("{}; rejected", problem->message);
  };
  for (;;) {
    auto letter = status_.take_letter(deadline, stop);
    if (stop.stop_requested()) return Error{Code::kCancelled, "robot: stopped on request"};
    if (!letter) {
      if (!problem) return silent("robot", wire::topics::kRobotStatus.name, patience, heard_);
      return Error{problem->code, problem->message + "; no good status followed"};
    }
    jostle_msgs::msg::RobotStatus& status = letter->sample;
    if (!is_robot(letter->writer)) {
      if (!robot_) continue;
      foreign_.warn("{}: a status of participant {:016x} was dropped: the robot is participant {:016x}",
                    wire::topics::kRobotStatus.name, letter->writer, *robot_);
      continue;
    }
    if (auto reading_result = from_message(status); !reading_result) {
      reject({Code::kInvalidArgument, wire::topics::kRobotStatus.name + ": " + reading_result.error().message});
      continue;
    }
    if (known_ && status.epoch() != epoch_) {
      return Error{Code::kUnavailable, fmt::format("robot: another commander took over: its epoch is {:x}, ours {:x}",
                                                   status.epoch(), epoch_)};
    }
    known_ = known_ || (sequence_number_ > 0 && status.epoch() == epoch_);
    heard_ = true;
    limits_ = status.limits();
    time_ = seconds(status.header());
    scene_ = status.scene();
    return std::move(status);
  }
}

Result<robot_bridge::RobotReading> RobotClient::read(std::stop_token stop) {
  status_.take_all();  // yesterday's news
  for (;;) {
    auto status_result = next_status(patience(), stop);
    if (!status_result) return status_result.error();
    repeat_if_at_work(*status_result);
    if (at_work_) return from_message(*status_result);
    const bool current = sequence_number_ == 0 ||
                         (status_result->epoch() == epoch_ && status_result->sequence_number() == sequence_number_);
    if (!current || status_result->busy()) continue;
    return from_message(*status_result);
  }
}

Result<void> RobotClient::wait_for_robot(std::stop_token stop) {
  const auto deadline = steady_clock::now() + options_.start;
  // Statuses come many times a second; each may be of another, newer robot.
  while (!heard_ || !robot_ || !command_.reaches(*robot_)) {
    if (steady_clock::now() >= deadline) {
      return Error{Code::kUnavailable, fmt::format("robot: who publishes {} does not read {} ({:.1f} s waited)",
                                                   wire::topics::kRobotStatus.name, wire::topics::kRobotCommand.name,
                                                   static_cast<double>(options_.start.count()) / 1e3)};
    }
    if (auto status_result = next_status(patience(), stop); !status_result) return status_result.error();
  }
  return {};
}

// A robot that can do harm wants to hear that somebody is still there. When it is not sent, it will miss it.
void RobotClient::repeat_if_at_work(const jostle_msgs::msg::RobotStatus& status) {
  if (!at_work_ || !status.busy()) return;
  idle_since_ = steady_clock::now();
  if (status.epoch() == epoch_) (void)command_.write(*at_work_);
}

Result<bool> RobotClient::hear_of(const jostle_msgs::msg::VelocityCommand& command, std::stop_token stop) {
  auto status_result = next_status(patience(), std::move(stop));
  if (!status_result) return status_result.error();
  repeat_if_at_work(*status_result);
  if (status_result->epoch() == epoch_) {
    const bool finished = status_result->sequence_number() >= command.sequence_number();
    if (const auto error = error_of(*status_result)) {
      const std::string words = common::shown(error->message, wire::limits::kShownError);
      if (finished || words != refusal_) {  // else it is an earlier command's
        refusal_ = words;
        return Error{error->code, "robot: " + words};
      }
    }
    if (finished) return true;
  }
  if (steady_clock::now() - idle_since_ > options_.start) return not_taken(*status_result);
  return false;
}

// The robot stands still, and does not say that it has our command.
Error RobotClient::not_taken(const jostle_msgs::msg::RobotStatus& status) const {
  const double seconds = static_cast<double>(options_.start.count()) / 1e3;
  if (status.epoch() == epoch_ || status.epoch() == 0) {
    return {Code::kUnavailable, fmt::format("robot: command {} was sent, and nothing of it was heard for {:.1f} s",
                                            sequence_number_, seconds)};
  }
  return {Code::kUnavailable, fmt::format("robot: it obeys another commander, of epoch {:x}, and took no command of "
                                          "ours for {:.1f} s; wait until that one's task is over, or end it",
                                          status.epoch(), seconds)};
}

Result<void> RobotClient::halt() {
  const auto deadline = steady_clock::now() + options_.silence;
  if (command_.write(stop_message(epoch_, ++sequence_number_))) {
    while (steady_clock::now() < deadline) {
      auto status_result = next_status(options_.stopping, {});
      if (!status_result) {
        return Error{status_result.error().code, "robot: told to stop; " + status_result.error().message};
      }
      const bool obeyed = status_result->epoch() == epoch_ && status_result->sequence_number() >= sequence_number_;
      if (obeyed && !status_result->busy()) return {};
    }
  }
  return Error{Code::kUnavailable, fmt::format("robot: told to stop, and not heard to stand still within {:.1f} s",
                                               static_cast<double>(options_.silence.count()) / 1e3)};
}

Result<void> RobotClient::start(std::span<const double> u, double duration, std::stop_token stop) {
  if (at_work_) return robot_bridge::action_at_work();
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
  at_work_ = std::move(command);
  idle_since_ = steady_clock::now();
  return {};
}

Result<bool> RobotClient::advance(std::stop_token stop) {
  if (!at_work_) return true;
  auto over = hear_of(*at_work_, std::move(stop));
  if (over && !*over) return over;
  at_work_.reset();
  if (over || over.error().code != Code::kCancelled) return over;
  if (auto halted = halt(); !halted) return halted.error();
  return over;
}

ObjectsClient::ObjectsClient(const wire::Participant& participant, const RobotClient& robot,
                             const WorldClientOptions& options)
    : robot_(robot), options_(options), states_(participant, wire::topics::kObjectStates, kQueue) {}

Result<std::vector<perception::ObjectReading>> ObjectsClient::read() {
  const auto patience = time_ < 0 ? options_.start : options_.silence;
  const auto deadline = steady_clock::now() + patience;
  std::optional<Error> problem;
  const auto reject = [&](Error error) {
    problem = std::move(error);
    rejected_.warn("{}; rejected", problem->message);
  };
  constexpr double kSameTime = 1e-6;  // s, rounding of stamps
  while (newest_.empty() || time_ < robot_.time() - kSameTime) {
    auto letter = states_.take_letter(deadline);
    if (!letter) {
      if (!problem) return silent("objects", wire::topics::kObjectStates.name, patience, time_ >= 0);
      return Error{problem->code, problem->message + "; no good measurement followed"};
    }
    if (const auto robot = robot_.participant(); robot && letter->writer != *robot && states_.hears(*robot)) {
      foreign_.warn("{}: a measurement of participant {:016x} was dropped: the robot's world is participant {:016x}",
                    wire::topics::kObjectStates.name, letter->writer, *robot);
      continue;
    }
    auto readings_result = from_message(letter->sample);
    if (readings_result) {
      newest_ = std::move(readings_result).value();
      time_ = seconds(letter->sample.header());
      scene_ = letter->sample.scene();
    } else {
      reject({Code::kInvalidArgument, wire::topics::kObjectStates.name + ": " + readings_result.error().message});
    }
  }
  return newest_;
}

}  // namespace jostle::world
