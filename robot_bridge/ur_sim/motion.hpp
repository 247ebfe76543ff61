#pragma once
/// \file
/// The motion functions of URScript, as a simulated controller performs them.

#include <optional>
#include <string_view>
#include <variant>
#include <vector>

#include "idl/types/result.hpp"
#include "robot_bridge/ur/kinematics.hpp"

namespace jostle::robot_bridge::ur_sim {

using ur::Joints;

/// Brings all joints to a stand, slowing down at `a`, rad/s².
struct StopJ {
  double a = 2.0;
};
/// Brings the joints to speeds qd, rad/s, at a, rad/s², and keeps them for t, s, since it began; 0: until they are
/// reached.
struct SpeedJ {
  Joints qd{};
  double a = 1.4, t = 0.0;
};
/// Follows q, rad, within t, s. The controller's own law is not published: here a joint goes as fast as reaches q in t,
/// and no faster than the arm may.
struct ServoJ {
  Joints q{};
  double t = 0.008;
};
/// Goes to q, rad, all joints at once, none faster than v, rad/s, nor accelerated by more than a, rad/s²; or, with t >
/// 0, in t, s.
struct MoveJ {
  Joints q{};
  double a = 1.4, v = 1.05, t = 0.0;
};
/// Takes the flange to a pose on a straight line: [x, y, z, rx, ry, rz], m and a rotation vector, rad, in the base. `a`
/// m/s², `v` m/s; or, with t > 0, in t, s.
struct MoveL {
  std::array<double, 6> pose{};
  double a = 1.2, v = 0.25, t = 0.0;
};
/// As SpeedJ, for the flange: [vx, vy, vz, wx, wy, wz], m/s and rad/s, in the base.
struct SpeedL {
  std::array<double, 6> xd{};
  double a = 1.4, t = 0.0;
};
/// Goes to q, rad, with speeds qd, rad/s, in t, s, from the speeds it has: cubic in time; quintic with accelerations
/// qdd, rad/s², too. Not a function of URScript, but what programs of the external-control contract interpolate.
struct Spline {
  Joints q{}, qd{}, qdd{};
  double t = 1.0;
  bool is_quintic = false;
};
/// Waits for t, s.
struct Sleep {
  double t = 0.0;
};
using Motion = std::variant<StopJ, SpeedJ, ServoJ, MoveJ, MoveL, SpeedL, Spline, Sleep>;

/// Reads a call such as "movej([0, -1.57, 0, 0, 0, 0], a=1.2, v=0.5)". Nothing if it is no call of a motion function.
/// Error kInvalidArgument naming what is wrong with one.
Result<std::optional<Motion>> parse_motion(std::string_view call);

/// Performs one motion after the other, and knows where the joints should be.
class MotionGenerator {
 public:
  static constexpr double kFastest = 3.1416;     ///< rad/s
  static constexpr double kAcceleration = 40.0;  ///< rad/s², the most that commands get

  /// Forgets what it did: the joints stand at q, and should.
  void reset(const Joints& q);
  void begin(const Motion& motion);
  /// Moves the target on by dt, s.
  void advance(double dt);
  /// Whether the function has returned. What moved then moves on, until something else begins.
  bool is_done() const { return done_; }

  const Joints& q() const { return q_; }    ///< rad
  const Joints& qd() const { return qd_; }  ///< rad/s

 private:
  void approach_speeds(const Joints& wanted, double a, double dt);
  void plan_ramps(double way, double a, double v, double t);
  double share_of_way() const;

  Motion motion_ = StopJ{};
  bool done_ = true;
  double elapsed_ = 0.0;                           // s, of the motion
  Joints start_{};                                 // rad, where it began
  double duration_ = 0.0, ramp_ = 0.0;             // s, of MoveJ and MoveL
  std::array<std::array<double, 6>, 6> spline_{};  // coefficients of each joint, from that of t^0
  Joints q_{}, qd_{}, qdd_{};                      // qdd: at the end of a spline
};

}  // namespace jostle::robot_bridge::ur_sim
