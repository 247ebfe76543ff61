#pragma once
/// \file
/// The program that runs on the controller for us: what moves the arm as the registers say, and stops it by itself when
/// they are not written any more.

#include <string>

namespace jostle::robot_bridge::ur {

/// The contract between the program and us. Values travel in RTDE's registers for external clients, 24 to 47.
///
///   input int 24      what to do: one of Command; written each cycle, which is what the watchdog looks at
///   input int 25      a number that the client counts up; the program answers it
///   input double 24 … 29   speeds of the joints, rad/s, from base to wrist 3; or positions, rad
///   input double 30   how fast joints may change their speed, rad/s²
///   output int 24     kReady while the program runs
///   output int 25     the newest number that the program obeyed
namespace contract {

inline constexpr const char* kName = "jostle_control";
inline constexpr int kBase = 24;  ///< the first register of each kind

enum Command : int {
  kHold = 0,        ///< stand still
  kSpeeds = 9,      ///< speedj
  kPositions = 11,  ///< servoj
  kExit = 255       ///< stop, and end the program
};

inline constexpr int kReady = 1;
inline constexpr double kWatchdog = 15.0;          ///< Hz: 67 ms without a write stop the arm
inline constexpr double kStopDeceleration = 15.0;  ///< rad/s²

}  // namespace contract

/// Returns the program's text, URScript, ready to be sent to the secondary interface.
/// `cycle`: the controller's, s: 0.008 or 0.002.
/// `watchdog`: how often the registers must be written, Hz.
std::string control_program(double cycle, double watchdog = contract::kWatchdog);

}  // namespace jostle::robot_bridge::ur
