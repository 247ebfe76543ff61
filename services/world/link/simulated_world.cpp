#include "services/world/link/simulated_world.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <thread>
#include <utility>

#include "physics_pool/objective/scorer.hpp"
#include "robot_bridge/safety/command_check.hpp"
#include "services/wire/limits.hpp"
#include "services/world/in_process/in_process_world.hpp"
#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

using std::chrono::steady_clock;

constexpr std::chrono::seconds kStandingTransforms{1};       // between equal transforms
constexpr std::chrono::milliseconds kPublicationPeriod{50};  // of wall-clock time
constexpr std::size_t kCommandQueue = 64;                    // of one participant
constexpr std::size_t kPastEpochs = 64;                      // remembered, for commands that are late

}  // namespace

SimulatedWorld::SimulatedWorld(const wire::Participant& participant, physics_pool::WorldPtr world,
                               const SimulatedWorldOptions& options)
    : options_(options),
      world_(world, options.noise),
      limits_(physics_pool::axis_limits(world->scene().robot.model)),
      still_(static_cast<std::size_t>(world->geometry().layout.nu), 0.0),
      joints_(participant, wire::topics::kJointStates),
      objects_(participant, wire::topics::kObjectStates),
      poses_(participant, wire::topics::kObjectPoses),
      transforms_(participant, wire::topics::kTransforms),
      clock_(participant, wire::topics::kClock),
      status_(participant, wire::topics::kRobotStatus),
      commands_(participant, wire::topics::kRobotCommand, kCommandQueue) {}

Result<void> SimulatedWorld::run(std::stop_token stop) {
  while (!stop.stop_requested()) {
    receive();
    if (actions_.empty()) {
      if (auto ok = rest(stop); !ok) return ok;
      continue;
    }
    const Action action = std::move(actions_.front());
    actions_.pop_front();
    if (auto ok = act(action, stop); !ok) {
      error_ = ok.error().message;
      publish();
      return ok;
    }
  }
  return {};
}

void SimulatedWorld::receive() {
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

void SimulatedWorld::say_troubles() {
  stale_.say();
  refused_.say();
  foreign_.say();
}

// While an action is at work: whether its commander has had enough of it.
bool SimulatedWorld::told_to_stop() {
  bool told = false;
  for (Letter& letter : commands_.take_letters()) {
    if (letter.writer != commander_) {
      make_wait(std::move(letter));
      continue;
    }
    const auto& command = letter.sample;
    told = told || (is_stop(command) && command.epoch() == epoch_ && command.sequence_number() > accepted_);
    waiting_.push_back(std::move(letter));
    if (waiting_.size() > kCommandQueue) waiting_.pop_front();  // as the inbox does
  }
  return told;
}

bool SimulatedWorld::may_command(const Letter& letter) const {
  return !commander_ || letter.writer == *commander_ || !commands_.hears(*commander_);
}

// The newest command of each counts.
void SimulatedWorld::make_wait(Letter letter) {
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

void SimulatedWorld::accept(Letter letter) {
  if (!may_command(letter)) return make_wait(std::move(letter));
  const auto& command = letter.sample;
  const bool known = letter.writer == commander_ && command.epoch() == epoch_;
  const bool over = !known && std::ranges::find(past_epochs_, command.epoch()) != past_epochs_.end();
  if (over || (known && command.sequence_number() <= accepted_)) {
    stale_.note("command {}/{} is stale, dropped", command.epoch(), command.sequence_number());
    return;
  }
  if (known || begin(command, letter.writer)) obey(command);
}

// Whether a newcomer, or a new epoch, takes over: with a good command only, for the present commander must not suffer
// for a bad one.
bool SimulatedWorld::begin(const jostle_msgs::msg::VelocityCommand& command, std::uint64_t writer) {
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

void SimulatedWorld::obey(const jostle_msgs::msg::VelocityCommand& command) {
  accepted_ = command.sequence_number();
  if (is_stop(command)) {
    finished_ = accepted_;
    actions_.clear();
    error_.clear();
    publish();
    return;
  }
  const auto check_result = robot_bridge::check_command(command.velocities(), limits_, command.duration());
  if (!check_result) {
    error_ = fmt::format("command {}: {}", command.sequence_number(), check_result.error().message);
    if (actions_.empty()) finished_ = accepted_;  // nobody waits for an earlier one
    refused_.note("{}; refused", error_);
    publish();
    return;
  }
  error_.clear();
  actions_.push_back({.epoch = command.epoch(),
                      .sequence_number = command.sequence_number(),
                      .u = command.velocities(),
                      .steps = std::lround(command.duration() / world_.world().time_step())});
}

Result<void> SimulatedWorld::act(const Action& action, std::stop_token stop) {
  busy_ = moved_ = true;
  world_.begin(action.u);
  const auto start = steady_clock::now();
  for (long i = 0; i < action.steps; ++i) {
    if (stop.stop_requested() || told_to_stop()) break;
    if (options_.rate > 0) {
      const std::chrono::duration<double> due(static_cast<double>(i) * world_.world().time_step() / options_.rate);
      std::this_thread::sleep_until(start + std::chrono::duration_cast<steady_clock::duration>(due));
    }
    publish_when_due();  // before the last step: its state is the next measurement's
    if (auto ok = world_.step(); !ok) return ok;
  }
  busy_ = false;
  finished_ = action.sequence_number;
  publish();
  return {};
}

// No action at work: the robot holds still, or the world stands still.
Result<void> SimulatedWorld::rest(std::stop_token stop) {
  publish_when_due();
  if (!options_.free_running) {
    if (auto letter = commands_.take_letter(next_publication_, stop)) accept(*std::move(letter));
    return {};
  }
  const double time_step = world_.world().time_step();
  world_.begin(still_);
  if (auto ok = world_.step(); !ok) return ok;
  const double rate = options_.rate > 0 ? options_.rate : 1.0;
  std::this_thread::sleep_for(std::chrono::duration<double>(time_step / rate));
  return {};
}

void SimulatedWorld::publish_when_due() {
  if (steady_clock::now() >= next_publication_) publish();
}

void SimulatedWorld::publish() {
  next_publication_ = steady_clock::now() + kPublicationPeriod;
  const physics_pool::TaskGeometry& geometry = world_.world().geometry();
  const State& truth = world_.state();
  const double time = world_.time();
  const State seen =
      physics_pool::observed_state(world_.world().scene(), options_.belief, truth,
                                   moved_ ? physics_pool::Measurement::kFeedback : physics_pool::Measurement::kInitial);
  const auto objects = to_message(object_readings(geometry.layout, seen), time);
  // States: when one is lost, the next one follows within kPublicationPeriod and says as much.
  rosgraph_msgs::msg::Clock clock;
  clock.clock(make_header(time).stamp());
  (void)clock_.write(clock);
  (void)objects_.write(objects);
  (void)poses_.write(pose_array_message(objects));
  // tf2 complains of a transform that it has: while the world stands still, one now and then serves who comes late.
  if (time != transforms_time_ || steady_clock::now() >= next_transforms_) {
    transforms_time_ = time;
    next_transforms_ = steady_clock::now() + kStandingTransforms;
    (void)transforms_.write(transform_message(objects));
  }
  const auto joints = joint_state_message(geometry.layout, truth, time);
  (void)joints_.write(joints);

  jostle_msgs::msg::RobotStatus status;
  status.header(make_header(time));
  status.epoch(epoch_);
  status.sequence_number(finished_);
  status.busy(busy_ || !actions_.empty());
  status.in_hand(in_hand_message(physics_pool::object_in_hand(geometry, truth)));
  status.error(error_);
  status.q(joints.position());
  status.v(joints.velocity());
  status.limits(limits_);
  (void)status_.write(status);  // last: who sees a command finished finds its objects sent
}

}  // namespace jostle::world
