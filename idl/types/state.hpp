#pragma once
/// \file
/// State, controls and trajectories: the words every room shares.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

namespace jostle {

/// x = (q, v) in engine order. A free body takes 7 numbers of q (position in
/// the world, then quaternion w, x, y, z) and 6 of v (linear velocity in the
/// world frame, angular velocity in the body frame).
struct State {
  std::vector<double> q;  ///< [nq] m, rad, unit quaternion
  std::vector<double> v;  ///< [nv] m/s, rad/s

  bool operator==(const State&) const = default;
};

/// Where one movable object sits in a State.
struct ObjectSlot {
  std::string name;
  int q = 0;  ///< first of 7 entries of State::q
  int v = 0;  ///< first of 6 entries of State::v

  bool operator==(const ObjectSlot&) const = default;
};

/// Names the parts of a State. The robot's joints come first; then the objects.
/// A planar gripper has x, y [m], rotation [rad], left and right finger [m]; a
/// pusher has x and y.
struct StateLayout {
  int nq = 0;
  int nv = 0;
  int nu = 0;                       ///< size of one control
  std::vector<std::string> joints;  ///< robot joints; entry i is q[i] and v[i]
  std::vector<ObjectSlot> objects;
  int target = -1;  ///< index into objects

  int robot_joints() const { return static_cast<int>(joints.size()); }

  bool operator==(const StateLayout&) const = default;
};

/// Joint positions inside State::q of the planar gripper; a pusher has the first two.
enum RobotJoint : int { kJointX, kJointY, kJointRotation, kJointLeft, kJointRight, kGripperJoints, kPusherJoints = 2 };

/// Entries of one control u: velocities of x, y [m/s], rotation [rad/s] and
/// opening [m/s; the distance between the fingers grows]. Thesis, Sec. 3.1. A
/// pusher has the first two (Sec. 6.1).
enum ControlAxis : int { kControlX, kControlY, kControlRotation, kControlOpening, kGripperAxes, kPusherAxes = 2 };

/// U = u_0 … u_{n-1}, each held for the step duration of its user.
struct ControlSequence {
  int nu = kGripperAxes;
  std::vector<double> values;  ///< [n][nu] row-major, m/s and rad/s

  int steps() const { return nu > 0 ? static_cast<int>(values.size()) / nu : 0; }
  std::span<double> step(int t) { return {values.data() + index(t), size(nu)}; }
  std::span<const double> step(int t) const { return {values.data() + index(t), size(nu)}; }
  void append(std::span<const double> u) { values.insert(values.end(), u.begin(), u.end()); }
  void truncate(int steps) { values.resize(index(steps)); }
  void drop_first() { values.erase(values.begin(), values.begin() + nu); }

  bool operator==(const ControlSequence&) const = default;

 private:
  static std::size_t size(int n) { return static_cast<std::size_t>(n); }
  std::size_t index(int t) const { return size(t) * size(nu); }
};

/// X = x_0 … x_n, at the borders of the control steps.
using Trajectory = std::vector<State>;

}  // namespace jostle
