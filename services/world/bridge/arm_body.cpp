#include "services/world/bridge/arm_body.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;
using robot_bridge::robotiq::Object;

enum Axis : std::size_t { kX, kY, kRotation, kOpening };
constexpr auto kTick = 2ms;
constexpr auto kLate = 1s;            // that a motion may take longer than it should: then something is wrong
constexpr double kFastestHand = 0.5;  // m/s
constexpr double kFastestTurn = 1.5;  // rad/s
constexpr const char* kJointNames[] = {"shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
                                       "wrist_1_joint",      "wrist_2_joint",       "wrist_3_joint"};

}  // namespace

ArmBody::ArmBody(const wire::Participant& participant, robot_bridge::ur::PlanarArm& arm,
                 robot_bridge::robotiq::Client* gripper, std::chrono::milliseconds patience)
    : arm_(arm), gripper_(gripper), patience_(patience), joints_(participant, wire::topics::kJointStates) {
  hand_.opening = opening_ = robot_bridge::robotiq::kStroke;
}

std::vector<double> ArmBody::limits() const {
  return {kFastestHand, kFastestHand, kFastestTurn, robot_bridge::robotiq::kFastest};
}

void ArmBody::refresh() {
  report_ = arm_.report();
  if (gripper_) hand_ = gripper_->report();
}

std::string ArmBody::trouble() {
  refresh();
  if (!report_.is_ready) {
    const std::string why = arm_.trouble();
    return why.empty() ? "the arm is not ready" : why;
  }
  return gripper_ && !hand_.is_ready ? hand_.trouble : "";
}

Result<void> ArmBody::begin(std::span<const double> u, double duration) {
  if (const std::string why = trouble(); !why.empty()) return Error{Code::kUnavailable, why};
  motion_ = arm_.move({u[kX], u[kY], u[kRotation]}, duration);
  opening_rate_ = u[kOpening];
  if (opening_rate_ != 0.0) opening_ = hand_.opening;
  moved_at_ = Clock::now();
  deadline_ = moved_at_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(duration)) + kLate;
  over_ = false;
  return {};
}

Result<void> ArmBody::advance() {
  std::this_thread::sleep_for(kTick);
  const auto now = Clock::now();
  const std::chrono::duration<double> passed = now - std::exchange(moved_at_, now);
  if (gripper_ && opening_rate_ != 0.0) {
    opening_ = std::clamp(opening_ + opening_rate_ * passed.count(), 0.0, robot_bridge::robotiq::kStroke);
    gripper_->move(opening_, std::abs(opening_rate_));
  }
  refresh();
  if (report_.over >= motion_) {
    over_ = true;
    if (report_.failed) return Error{Code::kUnavailable, arm_.trouble()};
  } else if (now > deadline_) {
    halt();
    return Error{Code::kUnavailable, "the arm did not end its motion in time"};
  }
  return {};
}

void ArmBody::halt() {
  arm_.halt();
  if (gripper_ && opening_rate_ != 0.0) gripper_->move(gripper_->report().opening, 0.0);
  over_ = true;
}

Result<bool> ArmBody::rest() {
  const std::string now = trouble();
  if (now != said_) {
    now.empty() ? spdlog::info("the arm is ready again") : spdlog::warn("{}", now);
    said_ = now;
  }
  return false;
}

double ArmBody::time() const {
  return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
}

robot_bridge::RobotReading ArmBody::reading() const {
  const double finger = 0.5 * hand_.opening, finger_speed = 0.5 * hand_.velocity;
  robot_bridge::RobotReading reading{
      .q = {report_.hand.x, report_.hand.y, report_.hand.rotation, finger, finger},
      .v = {report_.velocity.x, report_.velocity.y, report_.velocity.rotation, finger_speed, finger_speed},
      .object_in_hand = {}};
  // It tells once it was closed on something; before that, nobody asked it to close.
  if (gripper_ && hand_.object == Object::kMetWhileClosing) reading.object_in_hand = true;
  return reading;
}

void ArmBody::publish() {
  refresh();
  sensor_msgs::msg::JointState message;
  message.header(make_header(time()));
  for (std::size_t j = 0; j < report_.state.q.size(); ++j) {
    message.name().emplace_back(kJointNames[j]);
    message.position().push_back(report_.state.q[j]);
    message.velocity().push_back(report_.state.qd[j]);
  }
  (void)joints_.write(message);
}

}  // namespace jostle::world
