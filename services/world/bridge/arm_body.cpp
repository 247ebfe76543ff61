#include "services/world/bridge/arm_body.hpp"

#include <spdlog/spdlog.h>

#include <thread>
#include <utility>

#include "physics_pool/robot/robot_yaml.hpp"
#include "services/world/arm/arm_scene.hpp"
#include "services/world/bridge/arm_diagnostics.hpp"

namespace jostle::world {
namespace {

constexpr auto kTick = std::chrono::milliseconds(2);  // the fastest controllers' cycle
constexpr auto kDiagnosticsEvery = std::chrono::seconds(1);
constexpr const char* kJointNames[] = {"shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
                                       "wrist_1_joint",      "wrist_2_joint",       "wrist_3_joint"};

// The built-in arm, its joints called as UR's own driver for ROS 2 calls them.
physics_pool::RobotModel arm_model() {
  physics_pool::RobotModel model = physics_pool::builtin_robot("ur5_2f85").value();
  for (std::size_t j = 0; j < std::size(kJointNames); ++j) model.joints[j].name = kJointNames[j];
  return model;
}

}  // namespace

ArmBody::ArmBody(const wire::Participant& participant, robot_bridge::ur::ArmHand& hand, robot_bridge::Robot& robot,
                 const robot_bridge::planar::Mounting& mounting, std::chrono::milliseconds patience, std::string host)
    : hand_(hand),
      robot_(robot),
      patience_(patience),
      host_(std::move(host)),
      arm_(participant, arm_model(), pose_of(mounting.base), {}),
      diagnostics_(participant, wire::topics::kDiagnostics) {}

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

void ArmBody::publish() {
  tell_joints();
  const auto now = std::chrono::steady_clock::now();
  if (now < next_diagnostics_) return;
  next_diagnostics_ = now + kDiagnosticsEvery;
  (void)diagnostics_.write(diagnostics_of(hand_.condition(), host_, reading().stamp));
}

void ArmBody::tell_joints() {
  const robot_bridge::RobotReading hand = reading();
  const robot_bridge::ur::ArmState& state = hand_.arm_state();
  if (state.received == told_ || hand.q.size() <= kRightFinger) return;  // nothing new, or nothing was ever read
  told_ = state.received;
  State x{.q = {state.q.begin(), state.q.end()}, .v = {state.qd.begin(), state.qd.end()}};
  for (const std::size_t finger : {kLeftFinger, kRightFinger}) {
    x.q.push_back(hand.q[finger]);
    x.v.push_back(hand.v[finger]);
  }
  arm_.tell(x, hand.stamp);
}

}  // namespace jostle::world
