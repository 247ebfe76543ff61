#include "services/world/link/robot_server.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "robot_bridge/safety/command_check.hpp"
#include "services/wire/limits.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

using std::chrono::steady_clock;

constexpr std::size_t kCommandQueue = 64;  // of one participant
constexpr std::size_t kPastEpochs = 64;    // remembered, for commands that are late

}  // namespace

RobotServer::RobotServer(const wire::Participant& participant, Body& body)
    : body_(body),
      scene_(body.scene()),
      limits_(body.limits()),
      status_(participant, wire::topics::kRobotStatus),
      commands_(participant, wire::topics::kRobotCommand, kCommandQueue) {}

Result<void> RobotServer::run(std::stop_token stop) {
  while (!stop.stop_requested()) {
    receive();
    if (actions_.empty()) {
      if (auto ok = rest(stop); !ok) return ok;
      continue;
    }
    const Action action = std::move(actions_.front());
    actions_.pop_front();
    if (auto ok = act(action, stop); !ok) {
      publish();
      return ok;
    }
  }
  return {};
}

void RobotServer::receive() {
  for (Letter& letter : std::exchange(waiting_, {})) accept(std::move(letter));
  for (Letter& letter : commands_.take_letters()) accept(std::move(letter));
  for (Newcomer& newcomer : std::exchange(newcomers_, {})) {
    if (may_command(newcomer.letter)) {
      accept(std::move(newcomer.letter));
    } else if (steady_clock::now() < newcomer.since + wire::limits::kNewcomerWaits) {
      newcomers_.push_back(std::move(newcomer));
    } else {
      foreign_.note("a command of participant {:016x} was dropped: the robot obeys participant {:016x}, which is there",
                    newcomer.letter.writer, *commander_);
    }
  }
  say_troubles();
}

void RobotServer::say_troubles() {
  stale_.say();
  refused_.say();
  foreign_.say();
}

// While an action is at work: whether its commander has had enough of it, or says what it should not.
std::optional<Error> RobotServer::interrupted(const Action& action) {
  std::optional<Error> why;
  for (Letter& letter : commands_.take_letters()) {
    if (letter.writer != commander_) {
      make_wait(std::move(letter));
      continue;
    }
    heard_ = steady_clock::now();
    const auto& command = letter.sample;
    if (command.epoch() == action.epoch && command.sequence_number() == action.sequence_number) continue;  // repeated
    const bool stops = is_stop(command) && command.epoch() == epoch_ && command.sequence_number() > accepted_;
    if (stops) {
      why = Error{Code::kCancelled, "told to stop"};
    } else if (const auto harm = body_.patience() ? harm_of(command, action) : std::nullopt) {
      if (!why) why = Error{Code::kInvalidArgument, *harm + "; the motion was ended"};
      if (command.epoch() != epoch_) continue;  // who means it says it again, to a robot that stands
    }
    waiting_.push_back(std::move(letter));
    if (waiting_.size() > kCommandQueue) waiting_.pop_front();  // as the inbox does
  }
  return why;
}

// What is wrong with a command of the commander that comes while an action is at work.
std::optional<std::string> RobotServer::harm_of(const jostle_msgs::msg::VelocityCommand& command,
                                                const Action& action) const {
  if (command.epoch() != epoch_) {
    return fmt::format("command {}/{} came while one of epoch {} was at work", command.epoch(),
                       command.sequence_number(), epoch_);
  }
  if (command.sequence_number() < action.sequence_number) {
    return fmt::format("command {} came out of order, after {}", command.sequence_number(), action.sequence_number);
  }
  const auto ok = robot_bridge::check_command(command.velocities(), limits_, command.duration());
  if (ok) return {};
  return fmt::format("command {}: {}", command.sequence_number(), ok.error().message);
}

bool RobotServer::may_command(const Letter& letter) const {
  return !commander_ || letter.writer == *commander_ || !commands_.hears(*commander_);
}

// The newest command of each counts.
void RobotServer::make_wait(Letter letter) {
  const auto same =
      std::ranges::find_if(newcomers_, [&](const Newcomer& other) { return other.letter.writer == letter.writer; });
  if (same != newcomers_.end()) {
    same->letter = std::move(letter);
    foreign_.note("commands of participant {:016x} were dropped: the robot obeys participant {:016x}, which is there",
                  same->letter.writer, *commander_);
    return;
  }
  if (newcomers_.size() >= wire::limits::kSendersPerInbox) newcomers_.pop_front();
  foreign_.note("a command of participant {:016x} waits: the robot obeys participant {:016x}, which is there",
                letter.writer, *commander_);
  newcomers_.push_back({std::move(letter), steady_clock::now()});
}

void RobotServer::accept(Letter letter) {
  if (!may_command(letter)) return make_wait(std::move(letter));
  const auto& command = letter.sample;
  const bool known = letter.writer == commander_ && command.epoch() == epoch_;
  const bool over = !known && std::ranges::find(past_epochs_, command.epoch()) != past_epochs_.end();
  if (known && command.sequence_number() == accepted_) return;  // repeated, and came when it was done
  if (over || (known && command.sequence_number() <= accepted_)) {
    stale_.note("command {}/{} is stale, dropped", command.epoch(), command.sequence_number());
    return;
  }
  if (known || begin(command, letter.writer)) obey(command);
}

// Whether a newcomer, or a new epoch, takes over: with a good command only, for the present commander must not suffer
// for a bad one.
bool RobotServer::begin(const jostle_msgs::msg::VelocityCommand& command, std::uint64_t writer) {
  const auto check_result = robot_bridge::check_command(command.velocities(), limits_, command.duration());
  if (!check_result) {
    refused_.note("command {}/{} of a newcomer: {}; refused", command.epoch(), command.sequence_number(),
                  check_result.error().message);
    return false;
  }
  if (commander_) past_epochs_.push_back(epoch_);
  if (past_epochs_.size() > kPastEpochs) past_epochs_.pop_front();
  commander_ = writer;
  epoch_ = command.epoch();
  finished_ = accepted_ = 0;
  actions_.clear();
  waiting_.clear();
  return true;
}

void RobotServer::obey(const jostle_msgs::msg::VelocityCommand& command) {
  accepted_ = command.sequence_number();
  if (is_stop(command)) {
    finished_ = accepted_;
    actions_.clear();
    error_.reset();
    publish();
    return;
  }
  const auto check_result = robot_bridge::check_command(command.velocities(), limits_, command.duration());
  if (!check_result) {
    error_ = Error{check_result.error().code,
                   fmt::format("command {}: {}", command.sequence_number(), check_result.error().message)};
    if (actions_.empty()) finished_ = accepted_;  // nobody waits for an earlier one
    refused_.note("{}; refused", error_->message);
    publish();
    return;
  }
  error_.reset();
  actions_.push_back({.epoch = command.epoch(),
                      .sequence_number = command.sequence_number(),
                      .u = command.velocities(),
                      .duration = command.duration()});
}

Result<void> RobotServer::act(const Action& action, std::stop_token stop) {
  busy_ = true;
  auto moved = move(action, std::move(stop));
  busy_ = false;
  finished_ = action.sequence_number;
  if (!moved) error_ = moved.error();
  if (!moved && moved.error().code == Code::kInternal) return moved;
  if (!moved) {
    refused_.note("command {}/{} ended early: {}", action.epoch, action.sequence_number, error_->message);
    actions_.clear();  // they counted on this one
    finished_ = accepted_;
  }
  publish();
  return {};
}

Result<void> RobotServer::move(const Action& action, std::stop_token stop) {
  if (auto ok = body_.begin(action.u, action.duration); !ok) return ok;
  heard_ = steady_clock::now();
  while (!body_.is_over()) {
    if (stop.stop_requested()) {
      body_.halt();
      break;
    }
    if (auto why = interrupted(action)) {
      body_.halt();
      if (why->code == Code::kCancelled) break;
      return *std::move(why);
    }
    if (const auto patience = body_.patience(); patience && steady_clock::now() - heard_ > *patience) {
      body_.halt();
      return Error{Code::kUnavailable,
                   fmt::format("its commander was not heard for {} ms; the motion was ended", patience->count())};
    }
    publish_when_due();  // before the last step: its state is the next measurement's
    if (auto ok = body_.advance(); !ok) return ok;
  }
  return {};
}

Result<void> RobotServer::rest(std::stop_token stop) {
  publish_when_due();
  const auto went_by = body_.rest();
  if (!went_by) return went_by.error();
  if (*went_by) return {};
  if (auto letter = commands_.take_letter(next_publication_, stop)) accept(*std::move(letter));
  return {};
}

void RobotServer::publish_when_due() {
  if (steady_clock::now() >= next_publication_) publish();
}

void RobotServer::publish() {
  next_publication_ = steady_clock::now() + body_.period();
  body_.publish();
  const robot_bridge::RobotReading reading = body_.reading();
  jostle_msgs::msg::RobotStatus status;
  status.header(make_header(reading.stamp));
  status.epoch(epoch_);
  status.sequence_number(finished_);
  status.busy(busy_ || !actions_.empty());
  status.in_hand(in_hand_message(reading.object_in_hand));
  put_error(error_, status);
  status.q(reading.q);
  status.v(reading.v);
  status.limits(limits_);
  status.scene(scene_);
  // A state: when one is lost, the next one follows soon and says as much. It comes last: who sees
  // a command finished finds its objects sent.
  (void)status_.write(status);
}

}  // namespace jostle::world
