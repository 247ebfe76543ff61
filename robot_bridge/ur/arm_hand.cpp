#include "robot_bridge/ur/arm_hand.hpp"

#include <algorithm>
#include <cmath>
#include <thread>
#include <utility>

#include "robot_bridge/safety/command_check.hpp"

namespace jostle::robot_bridge::ur {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
using robotiq::Object;

enum Axis : std::size_t { kX, kY, kRotation, kOpening };
constexpr auto kTick = 2ms;
constexpr auto kLate = 1s;            // that a motion may take longer than it should: then something is wrong
constexpr double kFastestHand = 0.5;  // m/s
constexpr double kFastestTurn = 1.5;  // rad/s
constexpr double kStill = 0.01;       // rad/s, of every joint

bool stands_still(const ArmState& state) {
  return std::ranges::all_of(state.qd, [](double speed) { return std::abs(speed) < kStill; });
}

double time_of_day(Clock::time_point when) {
  const auto age = Clock::now() - when;
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch() - age).count();
}

}  // namespace

ArmHand::ArmHand(PlanarArm& arm, robotiq::Client* gripper) : arm_(arm), gripper_(gripper) {
  fingers_.opening = opening_ = robotiq::kStroke;
}

std::vector<double> ArmHand::limits() { return {kFastestHand, kFastestHand, kFastestTurn, robotiq::kFastest}; }

void ArmHand::refresh() {
  const auto before = report_.state.received;
  report_ = arm_.report();
  if (report_.state.received != before) stamp_ = time_of_day(report_.state.received);
  if (gripper_) fingers_ = gripper_->report();
}

std::string ArmHand::trouble() {
  refresh();
  if (!report_.is_ready) {
    const std::string why = arm_.trouble();
    return why.empty() ? "the arm is not ready" : why;
  }
  return gripper_ && !fingers_.is_ready ? fingers_.trouble : "";
}

ArmHand::Condition ArmHand::condition() {
  refresh();
  Condition condition{.arm = report_, .arm_trouble = arm_.trouble(), .calibration = arm_.calibration(), .gripper = {}};
  if (condition.arm_trouble.empty() && !report_.is_ready) condition.arm_trouble = "the arm is not ready";
  if (gripper_) condition.gripper = fingers_;
  return condition;
}

Result<RobotReading> ArmHand::read(std::stop_token stop) {
  if (stop.stop_requested()) return Error{Code::kCancelled, "robot: stopped on request"};
  refresh();
  if (!report_.is_connected) return Error{Code::kUnavailable, trouble()};
  const double finger = 0.5 * fingers_.opening, finger_speed = 0.5 * fingers_.velocity;
  RobotReading reading{
      .stamp = stamp_,
      .q = {report_.hand.x, report_.hand.y, report_.hand.rotation, finger, finger},
      .v = {report_.velocity.x, report_.velocity.y, report_.velocity.rotation, finger_speed, finger_speed},
      .object_in_hand = {}};
  // It tells once it was closed on something; before that, nobody asked it to close.
  if (gripper_ && fingers_.object == Object::kMetWhileClosing) reading.object_in_hand = true;
  return reading;
}

Result<void> ArmHand::start(std::span<const double> u, double duration, std::stop_token stop) {
  if (acts_) return action_at_work();
  if (auto ok = check_command(u, limits(), duration); !ok) return ok;
  if (stop.stop_requested()) return Error{Code::kCancelled, "robot: stopped before it moved"};
  if (std::string why = trouble(); !why.empty()) return Error{Code::kUnavailable, std::move(why)};
  motion_ = arm_.move({u[kX], u[kY], u[kRotation]}, duration);
  opening_rate_ = u[kOpening];
  if (opening_rate_ != 0.0) opening_ = fingers_.opening;
  moved_at_ = Clock::now();
  deadline_ = moved_at_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(duration)) + kLate;
  acts_ = true;
  return {};
}

Result<bool> ArmHand::advance(std::stop_token stop) {
  if (!acts_) return true;
  if (stop.stop_requested()) return end({Code::kCancelled, "robot: stopped in mid-action"});
  std::this_thread::sleep_for(kTick);
  move_fingers();
  refresh();
  if (report_.over >= motion_) {
    if (report_.failed) return end({Code::kUnavailable, arm_.trouble()});
    acts_ = false;
    return true;
  }
  if (Clock::now() > deadline_) return end({Code::kUnavailable, "the arm did not end its motion in time"});
  return false;
}

void ArmHand::move_fingers() {
  const auto now = Clock::now();
  const std::chrono::duration<double> passed = now - std::exchange(moved_at_, now);
  if (!gripper_ || opening_rate_ == 0.0) return;
  opening_ = std::clamp(opening_ + opening_rate_ * passed.count(), 0.0, robotiq::kStroke);
  gripper_->move(opening_, std::abs(opening_rate_));
}

// Stops the hand first; then there is time to see that it stands.
Error ArmHand::end(Error why) {
  arm_.halt();
  if (gripper_ && opening_rate_ != 0.0) gripper_->move(gripper_->report().opening, 0.0);
  acts_ = false;
  const auto halted = Clock::now();
  do {
    std::this_thread::sleep_for(kTick);
    refresh();
    if (!report_.is_connected) return why;  // the program on the controller stops it
    if (report_.state.received > halted && stands_still(report_.state)) return why;
  } while (Clock::now() < halted + kLate);
  return {Code::kUnavailable, why.message + "; told to stop, the arm was not seen to stand still"};
}

}  // namespace jostle::robot_bridge::ur
