#include "robot_bridge/ur/planar_arm.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

namespace jostle::robot_bridge::ur {
namespace {

using net::Clock;
using namespace std::chrono_literals;

constexpr auto kConnect = 2s;
constexpr auto kRetry = 300ms;
constexpr auto kWrite = 20ms;
constexpr auto kTend = 50ms;
constexpr auto kUnlockDelay = 5200ms;     // after a protective stop; controllers want 5 s
constexpr double kAcceleration = 15.0;    // rad/s²
constexpr double kLongestStep = 0.025;    // s: after a gap in the samples the path goes on from where it was
constexpr std::uint64_t kHeldEnough = 5;  // cycles

// Real-time priority where the system gives it.
void ask_for_priority() {
  sched_param parameters{};
  parameters.sched_priority = 60;
  (void)pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
}

void pause(std::chrono::milliseconds time, const std::stop_token& stop) {
  const auto end = Clock::now() + time;
  while (!stop.stop_requested() && Clock::now() < end) std::this_thread::sleep_for(10ms);
}

}  // namespace

PlanarArm::PlanarArm(const PlanarArmOptions& options)
    : options_(options),
      in_plane_(options.mounting, Dh::ur5()),
      control_([this](std::stop_token stop) { control(std::move(stop)); }),
      tending_([this](std::stop_token stop) { tend(std::move(stop)); }) {}

PlanarArm::~PlanarArm() = default;

std::uint64_t PlanarArm::move(const planar::PlanarVelocity& velocity, double duration) {
  orders_.put({.number = ++asked_, .velocity = velocity, .duration = duration});
  return asked_;
}

void PlanarArm::halt() { orders_.put({.number = ++asked_, .velocity = {}, .duration = 0.0}); }

const PlanarArm::Report& PlanarArm::report() {
  if (const auto report = reports_.take()) newest_ = *report;
  return newest_;
}

std::string PlanarArm::trouble() const {
  const std::lock_guard lock(mutex_);
  return trouble_;
}

std::optional<CalibrationError> PlanarArm::calibration() const {
  const std::lock_guard lock(mutex_);
  return calibration_;
}

void PlanarArm::say(const std::string& trouble) {
  const std::lock_guard lock(mutex_);
  trouble_ = trouble;
}

// --- the control thread ---------------------------------------------------------

void PlanarArm::control(std::stop_token stop) {
  ask_for_priority();
  while (!stop.stop_requested()) {
    auto rtde_result = RtdeClient::connect(options_.host, options_.rtde_port, 0.0, Clock::now() + kConnect);
    if (rtde_result) {
      meet_cycles(*rtde_result, stop);
    } else {
      leave(rtde_result.error().message);
    }
    if (!stop.stop_requested()) pause(kRetry, stop);
  }
}

void PlanarArm::meet_cycles(RtdeClient& rtde, std::stop_token stop) {
  cycle_ = rtde.cycle();
  const auto silence =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(3 * options_.watchdog));
  double last = -1.0;
  while (!stop.stop_requested()) {
    auto state_result = rtde.next(Clock::now() + silence);
    if (!state_result) return leave(state_result.error().message);
    const ArmState& state = *state_result;
    if (state.timestamp < last) return leave("the controller started anew");
    const double dt = last < 0 ? rtde.cycle() : std::clamp(state.timestamp - last, 0.0, kLongestStep);
    last = state.timestamp;
    report_.is_connected = true;
    report_.state = state;
    const planar::PlanarPose before = report_.hand;
    report_.hand = planar::planar_pose(options_.mounting, Dh::ur5(), state.q, before.rotation);
    const Eigen::Matrix<double, 6, 1> qd = Eigen::Map<const Eigen::Matrix<double, 6, 1>>(state.qd.data());
    const Eigen::Matrix<double, 6, 1> twist = jacobian(Dh::ur5(), state.q) * qd;  // of the flange, in the base
    const Eigen::Matrix3d R = options_.mounting.base.linear();
    const Eigen::Vector3d omega = R * twist.tail<3>();
    const Eigen::Vector3d arm = R * flange_pose(Dh::ur5(), state.q).linear() * options_.mounting.hand.translation();
    const Eigen::Vector3d speed = R * twist.head<3>() + omega.cross(arm);
    report_.velocity = {speed.x(), speed.y(), omega.z()};
    report_.is_ready = is_ready(state);
    ++report_.cycles;
    report_.missed = rtde.skipped();
    const ArmCommand command = decide(state, dt);
    held_ = command.command == contract::kHold ? held_ + 1 : 0;
    if (auto ok = rtde.send(command, Clock::now() + kWrite); !ok) return leave(ok.error().message);
    reports_.put(report_);
    tended_.put(report_);
  }
  // On the way out: stand still, and say so to the controller.
  if (auto ok = rtde.send({.command = contract::kHold, .number = ++number_}, Clock::now() + kWrite); !ok) return;
}

bool PlanarArm::is_ready(const ArmState& state) const {
  return state.robot_mode == RobotMode::kRunning && may_move(state.safety_mode) &&
         state.runtime_state == RuntimeState::kPlaying && state.program_state == contract::kReady;
}

void PlanarArm::end_motion(const std::string& why) {
  if (!moves_) return;
  moves_ = false;
  report_.over = order_.number;
  report_.failed = !why.empty();
  if (!why.empty()) say(why);
}

ArmCommand PlanarArm::decide(const ArmState& state, double dt) {
  ArmCommand command{.command = contract::kHold, .number = ++number_};
  if (const auto order = orders_.take()) {
    end_motion("another motion took its place");
    order_ = *order;
    left_ = order_.duration;
    moves_ = true;
    if (!report_.is_ready) {
      end_motion(trouble().empty() ? "the arm is not ready" : trouble());
    } else if (left_ <= 0.0) {
      end_motion("");
    } else if (auto ok = in_plane_.begin(state.q); !ok) {
      end_motion(ok.error().message);
    }
  } else if (moves_ && !report_.is_ready) {
    end_motion(fmt::format("the arm stopped: robot mode {}, safety mode {}, program {}", name_of(state.robot_mode),
                           name_of(state.safety_mode),
                           state.runtime_state == RuntimeState::kPlaying
                               ? "running"
                               : fmt::format("not running (its watchdog is {:.0f} ms)", 1e3 * options_.watchdog)));
  } else if (moves_) {
    left_ -= dt;
    if (left_ <= 1e-9) end_motion("");
  }
  if (!moves_) return command;
  auto speeds_result = in_plane_.follow(order_.velocity, state.q, std::max(dt, 1e-3));
  if (!speeds_result) {
    end_motion(speeds_result.error().message);
    return command;
  }
  command.command = contract::kSpeeds;
  command.values = *speeds_result;
  command.acceleration = kAcceleration;
  return command;
}

void PlanarArm::leave(const std::string& why) {
  end_motion(why);
  say(why);
  held_ = 0;
  report_.is_connected = report_.is_ready = false;
  reports_.put(report_);
  tended_.put(report_);
}

// --- getting the arm ready ------------------------------------------------------

void PlanarArm::tend(std::stop_token stop) {
  Report report;
  while (!stop.stop_requested()) {
    if (const auto news = tended_.take()) report = *news;
    if (report.is_connected && report.is_ready) {
      if (!trouble().empty() && !report.failed) say("");
    } else if (report.is_connected) {
      if (auto ok = get_ready(report.state, stop); !ok) say(ok.error().message);
    } else {
      const std::lock_guard lock(mutex_);
      calibration_.reset();  // who comes next may be another arm
    }
    pause(kTend, stop);
  }
}

// Before our program is on the controller, without which the arm is not ready.
Result<void> PlanarArm::look_at_calibration() {
  if (calibration()) return {};
  const auto calibrated_result = read_calibration(options_.host, options_.script_port, Clock::now() + kConnect);
  if (!calibrated_result) {
    return Error{calibrated_result.error().code, "the arm's calibration: " + calibrated_result.error().message};
  }
  const auto error_result = check_calibration(*calibrated_result, options_.mounting);
  if (!error_result) return error_result.error();
  const std::lock_guard lock(mutex_);
  calibration_ = *error_result;
  return {};
}

Result<void> PlanarArm::get_ready(const ArmState& state, const std::stop_token& stop) {
  const auto ask = [&](const std::string& command) -> Result<std::string> {
    auto dashboard_result = Dashboard::connect(options_.host, options_.dashboard_port, Clock::now() + kConnect);
    if (!dashboard_result) return dashboard_result.error();
    return dashboard_result->ask(command);
  };
  const auto refusal = [](const std::string& text) { return Error{Code::kUnavailable, text}; };
  if (state.safety_mode == SafetyMode::kProtectiveStop) {
    if (!options_.recovers) return refusal("protective stop: look at the arm, and unlock it on the teach pendant");
    say("protective stop: it is unlocked 5 s after it");
    pause(kUnlockDelay, stop);
    if (stop.stop_requested()) return {};
    if (auto closed = ask("close safety popup"); !closed) return closed.error();
    auto reply_result = ask("unlock protective stop");
    if (!reply_result) return reply_result.error();
    if (!reply_result->starts_with("Protective stop releasing")) return refusal(*reply_result);
    std::this_thread::sleep_for(100ms);
    return {};
  }
  if (!may_move(state.safety_mode)) {
    return refusal(fmt::format("safety mode {}: see the teach pendant", name_of(state.safety_mode)));
  }
  const auto command = [&](const char* words) -> Result<void> {
    if (!options_.powers_up) return refusal(fmt::format("robot mode {}: switch it on", name_of(state.robot_mode)));
    auto reply_result = ask(words);
    if (!reply_result) return reply_result.error();
    if (reply_result->starts_with("Not in remote"))
      return refusal("the arm is not in remote control: see the teach pendant");
    say(fmt::format("{}: {}", words, *reply_result));
    std::this_thread::sleep_for(300ms);
    return {};
  };
  switch (state.robot_mode) {
    case RobotMode::kPowerOff:
      return command("power on");
    case RobotMode::kIdle:
      return command("brake release");
    case RobotMode::kRunning:
      break;
    default:
      return refusal(fmt::format("robot mode {}", name_of(state.robot_mode)));
  }
  if (auto ok = look_at_calibration(); !ok) return ok;
  // The registers keep what they were told: nothing runs before they have said for a while that the arm stands still.
  if (held_ < kHeldEnough) return {};
  if (auto ok = upload(options_.host, options_.script_port, control_program(cycle_, 1.0 / options_.watchdog),
                       Clock::now() + kConnect);
      !ok)
    return ok;
  std::this_thread::sleep_for(200ms);
  return {};
}

}  // namespace jostle::robot_bridge::ur
