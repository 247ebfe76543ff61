#include "services/world/bridge/arm_guard.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <chrono>
#include <cmath>
#include <numbers>
#include <utility>

#include "robot_bridge/ur/arm_shapes.hpp"

namespace jostle::world {
namespace {

using robot_bridge::ur::Obstacle;

enum Joint : std::size_t { kX, kY, kRotation, kLeft, kRight };

// What good motion does was measured in 13 runs on the simulated arm (five seeds each of scenes/clutter.yaml and of
// three objects, three scenes of Sec. 3.3.1; 106 controls; other processes wanted both cores several times over). The
// largest: 2.2 mm, 4.3 mrad and, of a finger, 6.2 mm from the way, by samples that came late and by what closed-form
// kinematics and drives leave; 0.17 m/s and 1.08 rad/s between a control and the next. Speeds were up to 0.12 m/s and
// 0.57 rad/s, a quarter and a third of what the hand may do.
constexpr double kStray = 0.02;          // m: nine times as far
constexpr double kStrayTurn = 0.05;      // rad: twelve times
constexpr double kStrayFinger = 0.02;    // m: three times
constexpr double kMostChange = 0.35;     // m/s: twice as much
constexpr double kMostTurnChange = 2.0;  // rad/s: nearly twice

std::vector<Obstacle> obstacles_of(const std::vector<physics_pool::Fixture>& fixtures) {
  std::vector<Obstacle> obstacles;
  for (const physics_pool::Fixture& fixture : fixtures) {
    const auto& p = fixture.pose.position;
    const auto& o = fixture.pose.orientation;
    const std::array<double, 3> size =
        fixture.shape == physics_pool::Shape::kBox
            ? fixture.size
            : std::array<double, 3>{2 * fixture.radius, 2 * fixture.radius, fixture.height};
    obstacles.push_back({.name = fixture.name,
                         .X_WF = Eigen::Translation3d(p[0], p[1], p[2]) * Eigen::Quaterniond(o[0], o[1], o[2], o[3]),
                         .half = 0.5 * Eigen::Vector3d(size[0], size[1], size[2])});
  }
  return obstacles;
}

}  // namespace

robot_bridge::GuardOptions arm_guard(robot_bridge::ur::ArmHand& hand, const robot_bridge::ur::PlanarArmOptions& arm,
                                     const std::vector<physics_pool::Fixture>& fixtures) {
  namespace ur = robot_bridge::ur;
  robot_bridge::GuardOptions options;
  const std::vector<double> limits = ur::ArmHand::limits();
  options.axes = {{.limit = limits[0], .change = kMostChange, .joints = {{kX, 1.0}}},
                  {.limit = limits[1], .change = kMostChange, .joints = {{kY, 1.0}}},
                  {.limit = limits[2], .change = kMostTurnChange, .joints = {{kRotation, 1.0}}},
                  {.limit = limits[3], .joints = {{kLeft, 0.5}, {kRight, 0.5}}}};
  options.stray = {kStray, kStray, kStrayTurn, kStrayFinger, kStrayFinger};
  options.silence = std::chrono::milliseconds(std::lround(3e3 * arm.watchdog));  // as for the connection
  // The joints follow the hand from where they are; what is out of reach the arm itself refuses.
  options.touches = [&hand, mounting = arm.mounting, obstacles = obstacles_of(fixtures)](
                        std::span<const std::vector<double>> path) -> std::optional<std::string> {
    ur::Joints q = hand.arm_state().q;
    for (const std::vector<double>& place : path) {
      const Eigen::Isometry3d X_BT =
          robot_bridge::planar::flange_at(mounting, {place[kX], place[kY], place[kRotation]});
      const auto next = ur::nearest(ur::inverse(ur::Dh::ur5(), X_BT), q, 2 * std::numbers::pi);
      if (!next) return {};
      q = *next;
      if (const auto what = ur::touched(q, mounting.base, obstacles)) {
        return fmt::format("with the hand at ({:.3f}, {:.3f}) m, {:.2f} rad, {}", place[kX], place[kY],
                           place[kRotation], *what);
      }
    }
    return {};
  };
  options.tell = [](const std::string& report) { spdlog::error("the arm was stopped: {}", report); };
  return options;
}

}  // namespace jostle::world
