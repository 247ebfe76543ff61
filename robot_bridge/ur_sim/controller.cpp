#include "robot_bridge/ur_sim/controller.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <regex>
#include <sstream>
#include <utility>

#include "idl/types/number.hpp"

namespace jostle::robot_bridge::ur_sim {
namespace {

using ur::RobotMode;
using ur::RuntimeState;
using ur::SafetyMode;
using ur::rtde::Value;

constexpr double kBoot = 1.0;           // s; a real one takes a minute
constexpr double kPowerUp = 0.5;        // s, to POWER_ON and to IDLE each
constexpr double kBrakeRelease = 0.5;   // s
constexpr double kUnlockDelay = 5.0;    // s
constexpr double kStiffness = 20.0;     // 1/s: how fast a joint makes up for being behind
constexpr double kDeceleration = 15.0;  // rad/s², where a program ends or says no other
constexpr double kMostDeviation = 0.5;  // rad, behind its target: it hit something

// Codes of the registers' contract.
enum Command : int {
  kMove = 1,
  kLine = 3,
  kSpeedJ = 9,
  kSpeedL = 10,
  kServoJ = 11,
  kStopSpeed = 15,
  kStopServo = 16,
  kStopL = 33,
  kStopJ = 34,
  kProtectiveStop = 31,
  kSetWatchdog = 35,
  kExit = 255
};
constexpr int kReadyState = 1, kDoneState = 2;

Joints joints_of(const std::array<double, Controller::kRegisters>& registers, int first) {
  Joints q{};
  for (std::size_t j = 0; j < q.size(); ++j) q[j] = registers[static_cast<std::size_t>(first) + j];
  return q;
}

// "NAME_12" -> 12, for a field whose name begins with `prefix`.
std::optional<std::size_t> index_after(std::string_view name, std::string_view prefix) {
  if (!name.starts_with(prefix)) return {};
  return parse_whole<std::size_t>(name.substr(prefix.size()), 0, 127);
}

std::string without_blanks(std::string line) {
  line.erase(0, line.find_first_not_of(" \t\r"));
  line.erase(line.find_last_not_of(" \t\r") + 1);
  return line;
}

// The three sockets of the external-control contract, if a program opens them.
std::optional<Program::External> external_of(const std::string& text) {
  static const std::regex kOpen(R"re(socket_open\(\s*"([^"]+)"\s*,\s*(\d+)\s*,\s*"(\w+)"\s*\))re");
  Program::External external;
  for (auto open = std::sregex_iterator(text.begin(), text.end(), kOpen); open != std::sregex_iterator(); ++open) {
    const std::string name = (*open)[3];
    const auto port = parse_whole<int>((*open)[2].str(), 1, 65535);
    if (!port) continue;
    external.host = (*open)[1];
    std::uint16_t& place = name.starts_with("trajectory")       ? external.trajectory
                           : name.starts_with("script_command") ? external.script_command
                                                                : external.reverse;
    place = static_cast<std::uint16_t>(*port);
  }
  if (external.reverse == 0 || external.trajectory == 0) return {};
  return external;
}

}  // namespace

const Generation& Generation::cb3() {
  static const Generation generation{.model = "UR5", .version = {3, 15, 8, 106339}};
  return generation;
}

const Generation& Generation::e_series() {
  static const Generation generation{
      .model = "UR5e", .version = {5, 12, 6, 1102099}, .cycle = 0.002, .has_remote_control = true};
  return generation;
}

Result<Program> parse_program(const std::string& text) {
  static const std::regex kHead(R"((?:def|sec)\s+(\w+)\s*\(\s*\)\s*:)");
  static const std::regex kRegister(R"(read_input_integer_register\(\s*(\d+)\s*\))");
  static const std::regex kOffset(R"(reg_offset_int\s*=\s*(\d+))");
  static const std::regex kWatchdog(R"re(rtde_set_watchdog\(\s*"input_int_register_(\d+)"\s*,\s*([0-9.]+))re");
  Program program{.name = "unnamed", .text = text};
  std::smatch match;
  if (std::regex_search(text, match, kHead)) program.name = match[1];
  if (auto external = external_of(text)) {
    program.external = std::move(external);
    return program;
  }
  if (text.find("read_input_integer_register(") != text.npos) {
    // By a number, or by one behind an offset that stands in the text.
    const bool has_offset = std::regex_search(text, match, kOffset);
    const std::string first = has_offset || std::regex_search(text, match, kRegister) ? match[1].str() : "0";
    program.registers = parse_whole<int>(first, 0, Controller::kRegisters - 12);
    if (!program.registers) {
      return Error{Code::kInvalidArgument, fmt::format("program '{}': got register {}, wanted 0 to {}", program.name,
                                                       first, Controller::kRegisters - 12)};
    }
    // Who counts its commands in the second register wants each one obeyed at once.
    program.streams = text.find(fmt::format("read_input_integer_register({})", *program.registers + 1)) != text.npos;
    if (std::regex_search(text, match, kWatchdog)) program.watchdog = parse_number(match[2].str()).value_or(0.0);
    return program;
  }
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    line = without_blanks(line);
    if (line.empty() || line.starts_with('#') || line == "end" || std::regex_search(line, kHead)) continue;
    if (line.starts_with("textmsg(") || line.starts_with("popup(")) continue;
    auto motion_result = parse_motion(line);
    if (!motion_result) return motion_result.error();
    if (!*motion_result) {
      return Error{
          Code::kInvalidArgument,
          fmt::format("program '{}': got '{}', which a simulated controller does not know; it knows movej, servoj, "
                      "speedj, stopj, sleep, and programs that obey registers",
                      program.name, line.substr(0, 80))};
    }
    program.motions.push_back(**motion_result);
  }
  return program;
}

Controller::Controller(Plant& plant, const Generation& generation) : plant_(plant), generation_(generation) {
  motion_.reset(actual());
}

void Controller::say(Event::Kind kind, const std::string& text) const {
  if (on_event) on_event({kind, text});
}

bool Controller::power_on() {
  if (robot_mode_ != RobotMode::kPowerOff || safety_mode_ == SafetyMode::kFault) return false;
  if (safety_mode_ == SafetyMode::kRobotEmergencyStop) return false;
  if (next_mode_) return true;  // on its way
  next_mode_ = RobotMode::kPowerOn;
  mode_change_ = time_ + kPowerUp;
  return true;
}

void Controller::power_off() {
  end_program("power off");
  halt();
  next_mode_.reset();
  robot_mode_ = RobotMode::kPowerOff;
}

bool Controller::brake_release() {
  if (robot_mode_ != RobotMode::kIdle) return false;
  if (next_mode_) return true;  // on its way
  next_mode_ = RobotMode::kRunning;
  mode_change_ = time_ + kBrakeRelease;
  return true;
}

bool Controller::unlock_protective_stop() {
  if (safety_mode_ != SafetyMode::kProtectiveStop || time_ < stopped_at_ + kUnlockDelay) return false;
  safety_mode_ = SafetyMode::kNormal;
  motion_.reset(actual());
  return true;
}

void Controller::restart_safety() {
  power_off();
  safety_mode_ = SafetyMode::kNormal;
}

bool Controller::play() {
  if (program_.text.empty() || robot_mode_ != RobotMode::kRunning || !ur::may_move(safety_mode_)) return false;
  if (runtime_ == RuntimeState::kPaused) {
    runtime_ = RuntimeState::kPlaying;
    written_ = time_;
    return true;
  }
  run(Program(program_));
  return true;
}

bool Controller::pause() {
  if (!is_running()) return false;
  runtime_ = RuntimeState::kPaused;
  motion_.begin(StopJ{4.0});
  return true;
}

bool Controller::stop() {
  if (runtime_ == RuntimeState::kStopped) return false;
  end_program("stopped");
  return true;
}

void Controller::protective_stop(const std::string& why) {
  if (robot_mode_ != RobotMode::kRunning || !ur::may_move(safety_mode_)) return;
  safety_mode_ = SafetyMode::kProtectiveStop;
  stopped_at_ = time_;
  if (is_running()) runtime_ = RuntimeState::kPaused;
  halt();
  popup_ = "Protective stop: " + why;
  say(Event::Kind::kError, popup_);
}

void Controller::emergency_stop() {
  safety_mode_ = SafetyMode::kRobotEmergencyStop;
  end_program("emergency stop");
  halt();
  next_mode_.reset();
  robot_mode_ = RobotMode::kPowerOff;
  say(Event::Kind::kError, "Emergency stop");
}

void Controller::reboot() {
  end_program("reboot");
  halt();
  time_ = 0.0;
  ++boots_;
  program_ = {};
  popup_.clear();
  safety_mode_ = SafetyMode::kNormal;
  robot_mode_ = RobotMode::kBooting;
  next_mode_ = RobotMode::kPowerOff;
  mode_change_ = time_ + kBoot;
  input_ints_ = output_ints_ = {};
  input_doubles_ = output_doubles_ = {};
  speed_slider_ = 1.0;
}

void Controller::run(Program program) {
  if (runtime_ != RuntimeState::kStopped) end_program("another program starts");
  program_ = std::move(program);
  if (robot_mode_ != RobotMode::kRunning || !ur::may_move(safety_mode_)) {
    say(Event::Kind::kError,
        fmt::format("program {} cannot run: {}, {}", program_.name, name_of(robot_mode_), name_of(safety_mode_)));
    return;
  }
  runtime_ = RuntimeState::kPlaying;
  next_motion_ = 0;
  obeyed_ = false;
  motion_code_ = 0;
  written_ = time_;
  motion_.reset(actual());
  if (program_.registers) {
    const auto base = static_cast<std::size_t>(*program_.registers);
    output_ints_[base] = kReadyState;
    output_ints_[base + 1] = 0;
  }
  say(Event::Kind::kProgramStarted, program_.name);
  if (program_.external && on_external) on_external(*program_.external);
}

void Controller::end_program(const std::string&) {
  if (runtime_ == RuntimeState::kStopped) return;
  runtime_ = RuntimeState::kStopped;
  if (program_.registers) output_ints_[static_cast<std::size_t>(*program_.registers)] = 0;
  motion_.begin(StopJ{kDeceleration});
  say(Event::Kind::kProgramStopped, program_.name);
}

// Category 0: the brakes, whatever the program wants.
void Controller::halt() { motion_.reset(actual()); }

bool Controller::watchdog_barks() { return program_.watchdog > 0.0 && time_ - written_ > 1.0 / program_.watchdog; }

void Controller::obey_registers() {
  const auto base = static_cast<std::size_t>(*program_.registers);
  const int command = input_ints_[base];
  if (command == kExit) return end_program("told to exit");
  const Joints six = joints_of(input_doubles_, *program_.registers);
  const double seventh = input_doubles_[base + 6], eighth = input_doubles_[base + 7];
  if (program_.streams) {
    output_ints_[base + 1] = input_ints_[base + 1];
    if (command == kSpeedJ) {
      motion_.begin(SpeedJ{.qd = six, .a = seventh, .t = generation_.cycle});
    } else if (command == kServoJ) {
      motion_.begin(ServoJ{.q = six, .t = generation_.cycle});
    } else if (motion_code_ != command) {
      motion_.begin(StopJ{kDeceleration});
    }
    motion_code_ = command;
    return;
  }
  if (command == 0) {
    obeyed_ = false;
    output_ints_[base] = kReadyState;
    return;
  }
  if (!obeyed_) {
    obeyed_ = true;
    motion_code_ = command;
    switch (command) {
      case kMove:
        motion_.begin(MoveJ{.q = six, .a = eighth, .v = seventh});
        break;
      case kLine:
        motion_.begin(MoveL{.pose = six, .a = eighth, .v = seventh});
        break;
      case kSpeedJ:
        motion_.begin(SpeedJ{.qd = six, .a = seventh, .t = eighth});
        break;
      case kSpeedL:
        motion_.begin(SpeedL{.xd = six, .a = seventh, .t = eighth});
        break;
      case kServoJ:
        motion_.begin(ServoJ{.q = six, .t = std::max(eighth, generation_.cycle)});
        break;
      case kStopSpeed:
      case kStopServo:
      case kStopL:
      case kStopJ:
        motion_.begin(StopJ{std::max(input_doubles_[base], 1.0)});
        break;
      case kProtectiveStop:
        return protective_stop("asked for by its program");
      case kSetWatchdog:
        program_.watchdog = std::max(0.0, input_doubles_[base]);
        break;
      default:
        break;  // what is set, not moved: payload, tool, …
    }
  }
  // Speeds and servo targets are taken at once, and so is a motion that is not waited for.
  const bool streams = command == kSpeedJ || command == kSpeedL || command == kServoJ;
  const bool moves = command == kMove || command == kLine;
  const bool is_asynchronous = moves && input_ints_[base + 1] == 1;
  const bool waits = moves || command == kStopJ || command == kStopL || command == kStopSpeed || command == kStopServo;
  if (streams) {
    output_ints_[base] = kReadyState;
  } else if (!waits || is_asynchronous || motion_.is_done()) {
    output_ints_[base] = kDoneState;
  }
}

void Controller::run_motions() {
  if (next_motion_ > 0 && !motion_.is_done()) return;
  if (next_motion_ == program_.motions.size()) return end_program("its end");
  motion_.begin(program_.motions[next_motion_++]);
}

Result<void> Controller::tick() {
  const double dt = generation_.cycle;
  time_ += dt;
  if (next_mode_ && time_ >= mode_change_) {
    robot_mode_ = *std::exchange(next_mode_, std::nullopt);
    if (robot_mode_ == RobotMode::kPowerOn) {
      next_mode_ = RobotMode::kIdle;
      mode_change_ = time_ + kPowerUp;
    }
    motion_.reset(actual());
  }
  const bool may_move = robot_mode_ == RobotMode::kRunning && ur::may_move(safety_mode_);
  if (may_move && is_running()) {
    if (watchdog_barks()) {
      say(Event::Kind::kError, fmt::format("RTDE watchdog: input_int_register_{} was not written for {:.0f} ms",
                                           *program_.registers, 1e3 / program_.watchdog));
      end_program("watchdog");
    } else if (program_.registers) {
      obey_registers();
    } else if (!program_.external) {
      run_motions();
    }
  }
  Joints speeds{};
  if (may_move) {
    motion_.advance(dt);
    const Joints q = actual();
    for (std::size_t j = 0; j < q.size(); ++j) {
      const double behind = motion_.q()[j] - q[j];
      speeds[j] = motion_.qd()[j] + kStiffness * behind;
      if (std::abs(behind) > kMostDeviation) {
        protective_stop(fmt::format("joint {} is {:.2f} rad behind its target: it met something", j, std::abs(behind)));
      }
    }
    if (!ur::may_move(safety_mode_)) speeds = {};
  }
  return plant_.step(speeds, opening_rate ? opening_rate(dt) : 0.0, dt);
}

std::optional<Value> Controller::output(std::string_view name) const {
  using Getter = std::function<Value(const Controller&)>;
  static const std::map<std::string_view, Getter> kGetters{
      {"timestamp", [](const Controller& c) -> Value { return c.time_; }},
      {"actual_execution_time", [](const Controller&) -> Value { return 1e-3; }},
      {"target_q", [](const Controller& c) -> Value { return c.motion_.q(); }},
      {"target_qd", [](const Controller& c) -> Value { return c.motion_.qd(); }},
      {"actual_q", [](const Controller& c) -> Value { return c.plant_.positions(); }},
      {"actual_qd", [](const Controller& c) -> Value { return c.plant_.velocities(); }},
      {"robot_mode", [](const Controller& c) -> Value { return static_cast<std::int32_t>(c.robot_mode_); }},
      {"safety_mode", [](const Controller& c) -> Value { return static_cast<std::int32_t>(c.safety_mode_); }},
      {"safety_status", [](const Controller& c) -> Value { return static_cast<std::int32_t>(c.safety_mode_); }},
      {"runtime_state", [](const Controller& c) -> Value { return static_cast<std::uint32_t>(c.runtime_); }},
      {"robot_status_bits",
       [](const Controller& c) -> Value {
         const bool powered = c.robot_mode_ != RobotMode::kPowerOff && c.robot_mode_ != RobotMode::kBooting;
         return (powered ? ur::kPowerIsOn : 0u) | (c.is_running() ? ur::kProgramIsRunning : 0u);
       }},
      {"safety_status_bits",
       [](const Controller& c) -> Value {
         switch (c.safety_mode_) {
           case SafetyMode::kNormal:
             return ur::kSafetyNormal;
           case SafetyMode::kReduced:
             return ur::kSafetyReduced;
           case SafetyMode::kProtectiveStop:
             return ur::kSafetyProtectiveStopped | ur::kSafetyStopped;
           case SafetyMode::kRobotEmergencyStop:
             return ur::kSafetyRobotEmergencyStopped | ur::kSafetyEmergencyStopped | ur::kSafetyStopped;
           default:
             return ur::kSafetyFault | ur::kSafetyStopped;
         }
       }},
      {"joint_mode",
       [](const Controller& c) -> Value {
         std::array<std::int32_t, 6> modes;
         modes.fill(static_cast<std::int32_t>(c.robot_mode_ == RobotMode::kRunning ? ur::JointMode::kRunning
                                              : c.robot_mode_ == RobotMode::kIdle  ? ur::JointMode::kIdle
                                                                                   : ur::JointMode::kPowerOff));
         return modes;
       }},
      {"speed_scaling", [](const Controller& c) -> Value { return c.is_running() ? c.speed_slider_ : 0.0; }},
      {"target_speed_fraction", [](const Controller& c) -> Value { return c.speed_slider_; }},
      {"output_bit_registers0_to_31", [](const Controller& c) -> Value { return c.output_bits_[0]; }},
      {"output_bit_registers32_to_63", [](const Controller& c) -> Value { return c.output_bits_[1]; }},
      {"input_bit_registers0_to_31", [](const Controller& c) -> Value { return c.input_bits_[0]; }},
      {"input_bit_registers32_to_63", [](const Controller& c) -> Value { return c.input_bits_[1]; }},
      {"actual_TCP_pose",
       [](const Controller& c) -> Value {
         const Eigen::Isometry3d X = ur::flange_pose(ur::Dh::ur5(), c.plant_.positions());
         const Eigen::AngleAxisd turn(X.linear());
         const Eigen::Vector3d p = X.translation(), r = turn.angle() * turn.axis();
         return std::array<double, 6>{p.x(), p.y(), p.z(), r.x(), r.y(), r.z()};
       }},
  };
  if (const auto found = kGetters.find(name); found != kGetters.end()) return found->second(*this);
  if (const auto i = index_after(name, "output_int_register_"); i && *i < kRegisters) return output_ints_[*i];
  if (const auto i = index_after(name, "input_int_register_"); i && *i < kRegisters) return input_ints_[*i];
  if (const auto i = index_after(name, "output_double_register_"); i && *i < kRegisters) return output_doubles_[*i];
  if (const auto i = index_after(name, "input_double_register_"); i && *i < kRegisters) return input_doubles_[*i];
  if (const auto i = index_after(name, "output_bit_register_"); i && *i >= 64) return output_bools_[*i - 64];
  if (const auto i = index_after(name, "input_bit_register_"); i && *i >= 64) return input_bools_[*i - 64];
  // Currents, temperatures and the like: a field that is known and that nothing here has.
  const auto type = ur::rtde::output_field(name);
  if (!type) return {};
  return ur::rtde::zero_of(*type);
}

void Controller::set_input(std::string_view name, const Value& value) {
  if (const auto i = index_after(name, "input_int_register_"); i && *i < kRegisters) {
    input_ints_[*i] = std::get<std::int32_t>(value);
    if (program_.registers && static_cast<std::size_t>(*program_.registers) == *i) written_ = time_;
  } else if (const auto d = index_after(name, "input_double_register_"); d && *d < kRegisters) {
    input_doubles_[*d] = std::get<double>(value);
  } else if (name == "input_bit_registers0_to_31") {
    input_bits_[0] = std::get<std::uint32_t>(value);
  } else if (name == "input_bit_registers32_to_63") {
    input_bits_[1] = std::get<std::uint32_t>(value);
  } else if (const auto b = index_after(name, "input_bit_register_"); b && *b >= 64) {
    input_bools_[*b - 64] = std::get<bool>(value);
  } else if (name == "speed_slider_mask") {
    speed_slider_mask_ = std::get<std::uint32_t>(value);
  } else if (name == "speed_slider_fraction") {
    if (speed_slider_mask_ & 1u) speed_slider_ = std::clamp(std::get<double>(value), 0.0, 1.0);
  }
}

}  // namespace jostle::robot_bridge::ur_sim
