#pragma once
/// \file
/// What a controller says of its state: the numbers and names of its interfaces.

#include <cstdint>
#include <string_view>

namespace jostle::robot_bridge::ur {

/// RTDE's robot_mode, an INT32.
enum class RobotMode : std::int32_t {
  kNoController = -1,
  kDisconnected = 0,
  kConfirmSafety = 1,
  kBooting = 2,
  kPowerOff = 3,
  kPowerOn = 4,
  kIdle = 5,
  kBackdrive = 6,
  kRunning = 7,
  kUpdatingFirmware = 8
};

/// RTDE's safety_mode, an INT32.
enum class SafetyMode : std::int32_t {
  kNormal = 1,
  kReduced = 2,
  kProtectiveStop = 3,
  kRecovery = 4,
  kSafeguardStop = 5,
  kSystemEmergencyStop = 6,
  kRobotEmergencyStop = 7,
  kViolation = 8,
  kFault = 9,
  kValidateJointId = 10,
  kUndefined = 11
};

/// RTDE's runtime_state, a UINT32: of the program.
enum class RuntimeState : std::uint32_t {
  kStopping = 0,
  kStopped = 1,
  kPlaying = 2,
  kPausing = 3,
  kPaused = 4,
  kResuming = 5
};

/// RTDE's joint_mode, per joint an INT32; the two of them that matter here.
enum class JointMode : std::int32_t { kPowerOff = 239, kRunning = 253, kIdle = 255 };

/// Bits of RTDE's robot_status_bits.
inline constexpr std::uint32_t kPowerIsOn = 1u << 0;
inline constexpr std::uint32_t kProgramIsRunning = 1u << 1;

/// Bits of RTDE's safety_status_bits.
inline constexpr std::uint32_t kSafetyNormal = 1u << 0;
inline constexpr std::uint32_t kSafetyReduced = 1u << 1;
inline constexpr std::uint32_t kSafetyProtectiveStopped = 1u << 2;
inline constexpr std::uint32_t kSafetyRobotEmergencyStopped = 1u << 6;
inline constexpr std::uint32_t kSafetyEmergencyStopped = 1u << 7;
inline constexpr std::uint32_t kSafetyFault = 1u << 9;
inline constexpr std::uint32_t kSafetyStopped = 1u << 10;

/// Return the names that the dashboard uses, "POWER_OFF"; "UNKNOWN" for numbers that are none.
std::string_view name_of(RobotMode mode);
std::string_view name_of(SafetyMode mode);

/// Whether the arm may move in this safety mode.
constexpr bool may_move(SafetyMode mode) { return mode == SafetyMode::kNormal || mode == SafetyMode::kReduced; }

}  // namespace jostle::robot_bridge::ur
