#include "services/world/bridge/arm_body.hpp"

#include <spdlog/spdlog.h>

#include <thread>
#include <utility>

#include "services/world/link/messages.hpp"

namespace jostle::world {
namespace {

constexpr auto kTick = std::chrono::milliseconds(2);  // the fastest controllers' cycle
constexpr const char* kJointNames[] = {"shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
                                       "wrist_1_joint",      "wrist_2_joint",       "wrist_3_joint"};

}  // namespace

ArmBody::ArmBody(const wire::Participant& participant, robot_bridge::ur::ArmHand& hand, robot_bridge::Robot& robot,
                 std::chrono::milliseconds patience)
    : hand_(hand), robot_(robot), patience_(patience), joints_(participant, wire::topics::kJointStates) {}

Result<void> ArmBody::begin(std::span<const double> u, double duration) {
  auto ok = robot_.start(u, duration);
  over_ = !ok;
  return ok;
}

Result<void> ArmBody::advance() {
  const auto over = robot_.advance();
  over_ = !over || *over;
  tell_joints();
  if (!over) return over.error();
  return {};
}

void ArmBody::halt() {
  std::stop_source stop;
  stop.request_stop();
  const auto ended = robot_.advance(stop.get_token());
  over_ = true;
  if (!ended && ended.error().code != Code::kCancelled) spdlog::warn("{}", ended.error().message);
}

Result<bool> ArmBody::rest() {
  const std::string now = hand_.trouble();
  if (now != said_) {
    now.empty() ? spdlog::info("the arm is ready again") : spdlog::warn("{}", now);
    said_ = now;
  }
  tell_joints();
  std::this_thread::sleep_for(kTick);
  return true;
}

robot_bridge::RobotReading ArmBody::reading() {
  if (auto reading_result = robot_.read()) reading_ = std::move(reading_result).value();
  return reading_;
}

void ArmBody::tell_joints() {
  const double stamp = reading().stamp;
  const robot_bridge::ur::ArmState& state = hand_.arm_state();
  if (state.received == told_) return;
  told_ = state.received;
  sensor_msgs::msg::JointState message;
  message.header(make_header(stamp));
  for (std::size_t j = 0; j < state.q.size(); ++j) {
    message.name().emplace_back(kJointNames[j]);
    message.position().push_back(state.q[j]);
    message.velocity().push_back(state.qd[j]);
  }
  (void)joints_.write(message);
}

}  // namespace jostle::world
