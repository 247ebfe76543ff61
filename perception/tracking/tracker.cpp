#include "perception/tracking/tracker.hpp"

#include <Eigen/Geometry>
#include <cmath>

namespace jostle::perception {
namespace {

Eigen::Quaterniond quaternion(const std::array<double, 4>& wxyz) { return {wxyz[0], wxyz[1], wxyz[2], wxyz[3]}; }

}  // namespace

bool Tracker::take(const std::string& name, const std::array<double, 3>& position,
                   const std::array<double, 4>& orientation, double time) {
  const Eigen::Quaterniond measured = quaternion(orientation);
  if (!(measured.norm() > 0.5) || !std::isfinite(measured.norm()) || !std::isfinite(time)) return false;
  const Eigen::Quaterniond R_WB = measured.normalized();
  const auto [found, is_new] = tracks_.try_emplace(name);
  Track& track = found->second;
  const double dt = time - track.time;
  if (!is_new && dt < 0.0) return false;
  ObjectReading now{.name = name, .position = position, .orientation = {R_WB.w(), R_WB.x(), R_WB.y(), R_WB.z()}};
  if (!is_new && dt == 0.0) {
    now.linear = track.reading.linear;
    now.angular = track.reading.angular;
  } else if (!is_new && dt <= kLongestGap) {
    for (std::size_t i = 0; i < 3; ++i) now.linear[i] = (position[i] - track.reading.position[i]) / dt;
    const Eigen::AngleAxisd turn(quaternion(track.reading.orientation).conjugate() * R_WB);
    const double angle = std::remainder(turn.angle(), 2 * M_PI);
    const Eigen::Vector3d omega = angle / dt * turn.axis();
    now.angular = {omega.x(), omega.y(), omega.z()};
  }
  track = {.reading = std::move(now), .time = time};
  return true;
}

std::vector<ObjectReading> Tracker::readings(double time) const {
  std::vector<ObjectReading> readings;
  for (const auto& [name, track] : tracks_) {
    readings.push_back(track.reading);
    if (time - track.time <= kLongestGap) continue;
    readings.back().linear = {};
    readings.back().angular = {};
  }
  return readings;
}

}  // namespace jostle::perception
