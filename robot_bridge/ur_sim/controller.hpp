#pragma once
/// \file
/// A simulated controller of a Universal Robots arm: modes, safety, programs, registers. No sockets here: the servers
/// beside it put it on the wires.

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/result.hpp"
#include "robot_bridge/ur/modes.hpp"
#include "robot_bridge/ur/rtde.hpp"
#include "robot_bridge/ur_sim/motion.hpp"
#include "robot_bridge/ur_sim/plant.hpp"

namespace jostle::robot_bridge::ur_sim {

/// The generations of controllers.
struct Generation {
  std::string model;  ///< "UR5", "UR5e"
  ur::rtde::ControllerVersion version;
  double cycle = 0.008;                                   ///< s
  bool has_remote_control = false;                        ///< whether the teach pendant decides who may command
  ur::rtde::Version newest_rtde = ur::rtde::Version::k2;  ///< old software knows version 1 only

  static const Generation& cb3();
  static const Generation& e_series();
};

/// What a program does, as far as a simulated controller can know it: there is no interpreter of URScript. Known are
/// programs that obey registers, and lists of motions.
struct Program {
  std::string name;
  std::string text;
  std::optional<int> registers;  ///< the first register that it obeys, of a program that does
  bool streams = false;          ///< of those: whether it obeys each cycle, or once and waits to be told 0
  double watchdog = 0.0;         ///< Hz that the first register must be written with; 0: nobody watches
  /// Where a program of the external-control contract connects to: who commands it.
  struct External {
    std::string host;
    std::uint16_t reverse = 0, trajectory = 0, script_command = 0;  ///< ports
  };
  std::optional<External> external;
  std::vector<Motion> motions;  ///< of the others
};

/// Reads an uploaded text: a `def NAME(): … end`, or a single line.
/// Error kInvalidArgument naming what a simulated controller does not know; a real one would run it.
Result<Program> parse_program(const std::string& text);

/// A Controller moves a plant in cycles. Time passes in tick() only.
///
/// Threads  one at a time.
class Controller {
 public:
  static constexpr int kRegisters = 48;

  Controller(Plant& plant, const Generation& generation);

  /// One cycle: reads inputs, lets the program and the arm go on. Error kInternal: the physics diverged.
  Result<void> tick();

  // --- what the dashboard does; false: refused, for the state is another -----------
  bool power_on();
  void power_off();
  bool brake_release();
  /// Refused within kUnlockDelay of the stop.
  bool unlock_protective_stop();
  void restart_safety();
  bool play();
  bool pause();
  bool stop();

  // --- what happens to an arm ------------------------------------------------------
  void protective_stop(const std::string& why);
  void emergency_stop();
  /// The controller's computer starts anew, as after a power cut: everything is forgotten, clients are gone.
  void reboot();

  /// Runs an uploaded program in place of the one that runs.
  void run(Program program);

  /// What a program of the external-control contract does: begins a motion, asks whether it is done.
  void begin(const Motion& motion) { motion_.begin(motion); }
  bool motion_is_done() const { return motion_.is_done(); }
  const Joints& target() const { return motion_.q(); }         ///< rad
  const Joints& target_speed() const { return motion_.qd(); }  ///< rad/s
  /// Is called when such a program starts.
  std::function<void(const Program::External&)> on_external;

  // --- state -----------------------------------------------------------------------
  const Generation& generation() const { return generation_; }
  double time() const { return time_; }  ///< s since the start, which is 60 s: clients mistrust less than 40
  ur::RobotMode robot_mode() const { return robot_mode_; }
  ur::SafetyMode safety_mode() const { return safety_mode_; }
  ur::RuntimeState runtime_state() const { return runtime_; }
  bool is_running() const { return runtime_ == ur::RuntimeState::kPlaying; }
  const std::string& program_name() const { return program_.name; }
  bool in_remote_control() const { return remote_; }
  void set_remote_control(bool remote) { remote_ = remote; }
  const std::string& popup() const { return popup_; }
  void close_popup() { popup_.clear(); }
  void show_popup(std::string text) { popup_ = std::move(text); }
  int boots() const { return boots_; }  ///< how often it started anew

  /// Returns the value of an RTDE output; nothing for names that ur::rtde::output_field() does not know.
  std::optional<ur::rtde::Value> output(std::string_view name) const;
  /// Takes the value of an RTDE input, of the field's type.
  void set_input(std::string_view name, const ur::rtde::Value& value);

  /// What the primary interface tells its clients: of programs that start and stop, of errors.
  struct Event {
    enum class Kind { kProgramStarted, kProgramStopped, kError } kind;
    std::string text;
  };
  /// Is called from whatever makes it happen.
  std::function<void(const Event&)> on_event;

  /// What it tells of its arm's geometry, its calibration.
  ur::Dh kinematics = ur::Dh::ur5();

  /// What the gripper beside it wants: m/s. Part of the cycle, as one plant moves both.
  std::function<double(double dt)> opening_rate;

 private:
  void obey_registers();
  void run_motions();
  void end_program(const std::string& why);
  bool watchdog_barks();
  void halt();
  void say(Event::Kind kind, const std::string& text) const;
  Joints actual() const { return plant_.positions(); }

  Plant& plant_;
  const Generation generation_;
  double time_ = 60.0;
  int boots_ = 1;
  ur::RobotMode robot_mode_ = ur::RobotMode::kPowerOff;
  std::optional<ur::RobotMode> next_mode_;  // on the way to it
  double mode_change_ = 0.0;                // when it is there, s
  ur::SafetyMode safety_mode_ = ur::SafetyMode::kNormal;
  double stopped_at_ = 0.0;  // s, of the last protective stop
  ur::RuntimeState runtime_ = ur::RuntimeState::kStopped;
  bool remote_ = true;
  std::string popup_;

  Program program_;
  std::size_t next_motion_ = 0;
  bool obeyed_ = false;   // the command in the register, of a program that does not stream
  int motion_code_ = 0;   // of the registers, that began the present motion
  double written_ = 0.0;  // s, when the watched register was written last
  MotionGenerator motion_;

  std::array<std::int32_t, kRegisters> input_ints_{}, output_ints_{};
  std::array<double, kRegisters> input_doubles_{}, output_doubles_{};
  std::array<std::uint32_t, 2> input_bits_{}, output_bits_{};  // 0 to 63
  std::array<bool, 64> input_bools_{}, output_bools_{};        // 64 to 127
  double speed_slider_ = 1.0;
  std::uint32_t speed_slider_mask_ = 0;
};

}  // namespace jostle::robot_bridge::ur_sim
