#pragma once
/// \file
/// The primary and secondary interfaces (TCP ports 30001 and 30002): packets of state and messages out, programs in.
/// No sockets here.

#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "idl/types/bytes.hpp"
#include "idl/types/result.hpp"
#include "robot_bridge/ur/kinematics.hpp"
#include "robot_bridge/ur/modes.hpp"

namespace jostle::robot_bridge::ur::primary {

inline constexpr std::uint16_t kPort = 30001, kSecondaryPort = 30002;

/// What a version message says, the first packet of a connection.
struct Version {
  std::string project = "URControl";
  std::uint8_t major = 0, minor = 0;
  std::int32_t bugfix = 0, build = 0;
  std::string date = "01-01-2022";
};
Bytes version_message(const Version& version, std::uint64_t time);  ///< time: us

/// A program starts or stops: titles PROGRAM_XXX_STARTED and PROGRAM_XXX_STOPPED.
Bytes key_message(const std::string& title, const std::string& text, std::uint64_t time);
/// An error code; 210: this link is read-only.
Bytes error_message(std::int32_t code, std::int32_t argument, const std::string& text, std::uint64_t time);
Bytes text_message(const std::string& text, std::uint64_t time);

/// A state packet, as far as a client needs it: modes, joints, kinematics.
struct State {
  std::uint64_t time = 0;  ///< us
  RobotMode robot_mode = RobotMode::kPowerOff;
  SafetyMode safety_mode = SafetyMode::kNormal;
  bool is_program_running = false, is_program_paused = false;
  double speed_fraction = 1.0;
  Joints q{}, q_target{}, qd{};
  Dh kinematics;
};
Bytes state_packet(const State& state);

/// A packet that was received.
struct Packet {
  std::uint8_t type = 0;  ///< 16 state, 20 message
  Bytes body;
};
inline constexpr std::uint8_t kStateType = 16, kMessageType = 20;

/// Cuts a TCP stream into packets.
class PacketStream {
 public:
  void append(std::span<const std::uint8_t> bytes) { waiting_.insert(waiting_.end(), bytes.begin(), bytes.end()); }
  /// Error kInvalidArgument: a length below 5 or above 1 MiB, after which the stream has no meaning.
  Result<std::optional<Packet>> next();

 private:
  Bytes waiting_;
};

/// Reads the kinematics of an arm, its calibration, out of a state packet; nothing if the packet does not have it.
/// Error kInvalidArgument: a part whose length does not fit.
Result<std::optional<Dh>> read_kinematics(const Packet& packet);

}  // namespace jostle::robot_bridge::ur::primary
