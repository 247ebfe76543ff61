#include "robot_bridge/ur/calibration.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <numbers>

#include "robot_bridge/ur/primary.hpp"

namespace jostle::robot_bridge::ur {

Result<Dh> read_calibration(const std::string& host, std::uint16_t port, net::Clock::time_point deadline) {
  auto tcp_result = net::TcpClient::connect(host, port, deadline);
  if (!tcp_result) return tcp_result.error();
  primary::PacketStream stream;
  std::array<std::uint8_t, 4096> room;
  for (;;) {
    auto packet_result = stream.next();
    if (!packet_result) return packet_result.error();
    if (*packet_result) {
      auto kinematics_result = primary::read_kinematics(**packet_result);
      if (!kinematics_result) return kinematics_result.error();
      if (*kinematics_result) return **kinematics_result;
      continue;
    }
    auto bytes_result = tcp_result->read(room, deadline);
    if (!bytes_result) return bytes_result.error();
    stream.append(*bytes_result);
  }
}

CalibrationError compare(const Dh& calibrated, const planar::Mounting& mounting) {
  constexpr double kFar = 0.5, kStep = 0.1, kTurn = 1.0, kTurnStep = 0.5;  // m, m, rad, rad
  CalibrationError most;
  for (double x = -kFar; x <= kFar; x += kStep) {
    for (double y = -kFar; y <= kFar; y += kStep) {
      for (double rotation = -kTurn; rotation <= kTurn; rotation += kTurnStep) {
        const auto q = planar::joints_at(mounting, Dh::ur5(), {x, y, rotation});
        if (!q) continue;
        const Eigen::Isometry3d drawn = flange_pose(Dh::ur5(), *q) * mounting.hand;
        const Eigen::Isometry3d measured = flange_pose(calibrated, *q) * mounting.hand;
        most.distance = std::max(most.distance, (measured.translation() - drawn.translation()).norm());
        most.angle = std::max(most.angle, Eigen::AngleAxisd(drawn.linear().transpose() * measured.linear()).angle());
      }
    }
  }
  return most;
}

Result<CalibrationError> check_calibration(const Dh& calibrated, const planar::Mounting& mounting) {
  const CalibrationError error = compare(calibrated, mounting);
  if (error.distance <= kMostCalibrationDistance && error.angle <= kMostCalibrationAngle) return error;
  constexpr double kDegrees = 180 / std::numbers::pi;
  return Error{
      Code::kInvalidArgument,
      fmt::format("the arm's calibration: got a hand up to {:.1f} mm and {:.1f} degrees from where a UR5 as drawn "
                  "has it, wanted at most {:.0f} mm and {:.1f} degrees; is it a UR5, and was it calibrated?",
                  1e3 * error.distance, kDegrees * error.angle, 1e3 * kMostCalibrationDistance,
                  kDegrees * kMostCalibrationAngle)};
}

}  // namespace jostle::robot_bridge::ur
