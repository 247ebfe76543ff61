#pragma once
/// \file
/// RTDE over a socket: the client's side.

#include <cstdint>
#include <string>
#include <vector>

#include "idl/types/result.hpp"
#include "robot_bridge/net/tcp_client.hpp"
#include "robot_bridge/ur/control_program.hpp"
#include "robot_bridge/ur/kinematics.hpp"
#include "robot_bridge/ur/modes.hpp"
#include "robot_bridge/ur/rtde.hpp"

namespace jostle::robot_bridge::ur {

/// What a controller says in each cycle, as far as a bridge needs it.
struct ArmState {
  double timestamp = 0.0;             ///< s since the controller's start
  net::Clock::time_point received{};  ///< when it came
  Joints q{}, qd{}, q_target{};       ///< rad, rad/s
  RobotMode robot_mode = RobotMode::kNoController;
  SafetyMode safety_mode = SafetyMode::kUndefined;
  RuntimeState runtime_state = RuntimeState::kStopped;
  double speed_scaling = 0.0;      ///< 0 to 1
  std::int32_t program_state = 0;  ///< of our program: contract::kReady
  std::int32_t obeyed = 0;         ///< the newest number that our program obeyed
};

/// What the bridge says in each cycle.
struct ArmCommand {
  contract::Command command = contract::kHold;
  std::int32_t number = 0;
  Joints values{};            ///< rad/s, or rad
  double acceleration = 0.0;  ///< rad/s²
};

/// An RtdeClient is connected, has agreed on its recipes, and gets samples. It speaks version 2 of the protocol, with
/// controllers that refuse that version 1.
///
/// Threads  one at a time.
/// Errors   kUnavailable      the controller is gone, or does not answer; kDeadline: not in time
///          kInvalidArgument  it answered what no controller may, or refused a field: the message names it
class RtdeClient {
 public:
  /// `frequency`: samples/s; 0: as many as the controller makes.
  static Result<RtdeClient> connect(const std::string& host, std::uint16_t port, double frequency,
                                    net::Clock::time_point deadline);

  const rtde::ControllerVersion& version() const { return version_; }
  rtde::Version protocol() const { return protocol_; }
  /// Returns the controller's cycle, s, by its generation.
  double cycle() const { return version_.major >= 5 ? 0.002 : 0.008; }

  /// Returns the newest sample, once there is one that was not returned before. What came meanwhile is counted in
  /// skipped().
  Result<ArmState> next(net::Clock::time_point deadline);
  Result<void> send(const ArmCommand& command, net::Clock::time_point deadline);

  std::uint64_t skipped() const { return skipped_; }

 private:
  explicit RtdeClient(net::TcpClient tcp) : tcp_(std::move(tcp)) {}
  Result<rtde::Packet> answer(const rtde::Packet& request, net::Clock::time_point deadline);
  Result<void> agree(double frequency, net::Clock::time_point deadline);
  Result<ArmState> decode(const rtde::Packet& packet) const;

  net::TcpClient tcp_;
  rtde::PacketStream stream_;
  rtde::Version protocol_ = rtde::Version::k1;  // as every connection begins
  rtde::ControllerVersion version_;
  rtde::Recipe outputs_, inputs_;
  std::vector<rtde::Value> values_;  // of a command
  std::uint64_t skipped_ = 0;
};

}  // namespace jostle::robot_bridge::ur
