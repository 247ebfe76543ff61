#pragma once
/// \file
/// State, controls and trajectories: the words every room shares.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "idl/types/pose.hpp"

namespace jostle {

/// A State is x = (q, v) in engine order. A free body takes 7 numbers of q (position in
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

/// An ObjectView reads one object's part of a State, which outlives it.
class ObjectView {
 public:
  ObjectView(const ObjectSlot& slot, const State& x) : q_(&x.q[index(slot.q)]), v_(&x.v[index(slot.v)]) {}

  const double* position() const { return q_; }              ///< [3] p_WoBo_W, m
  const double* orientation() const { return q_ + 3; }       ///< [4] unit quaternion w, x, y, z
  const double* linear_velocity() const { return v_; }       ///< [3] m/s, in the world
  const double* angular_velocity() const { return v_ + 3; }  ///< [3] rad/s, in the body
  double yaw() const { return yaw_of(orientation()); }       ///< rad
  double uprightness() const { return jostle::uprightness(orientation()); }

 private:
  static std::size_t index(int i) { return static_cast<std::size_t>(i); }

  const double* q_;
  const double* v_;
};

/// A StateView reads the parts of a State by name. Layout and state outlive it.
class StateView {
 public:
  StateView(const StateLayout& layout, const State& x) : layout_(layout), x_(x) {}

  ObjectView object(std::size_t i) const { return {layout_.objects[i], x_}; }
  ObjectView target() const { return object(static_cast<std::size_t>(layout_.target)); }
  std::size_t objects() const { return layout_.objects.size(); }
  bool is_target(std::size_t i) const { return static_cast<int>(i) == layout_.target; }
  std::span<const double> joints() const { return {x_.q.data(), layout_.joints.size()}; }  ///< m, rad

 private:
  const StateLayout& layout_;
  const State& x_;
};

/// The controls U = u_0 … u_{n-1}. Each is held for one control step, whose duration is kept elsewhere.
struct ControlSequence {
  int nu = 0;                  ///< size of one control; 0 until the first is appended
  std::vector<double> values;  ///< [n][nu] row-major, by axis of the robot, m/s and rad/s

  int steps() const { return nu > 0 ? static_cast<int>(values.size()) / nu : 0; }
  std::span<double> step(int t) { return {values.data() + index(t), size(nu)}; }
  std::span<const double> step(int t) const { return {values.data() + index(t), size(nu)}; }
  /// Appends one control, or several in a row once nu is known.
  void append(std::span<const double> u) {
    if (nu == 0) nu = static_cast<int>(u.size());
    values.insert(values.end(), u.begin(), u.end());
  }
  void truncate(int steps) { values.resize(index(steps)); }
  void drop_first() { values.erase(values.begin(), values.begin() + nu); }

  bool operator==(const ControlSequence&) const = default;

 private:
  static std::size_t size(int n) { return static_cast<std::size_t>(n); }
  std::size_t index(int t) const { return size(t) * size(nu); }
};

/// A Trajectory is X = x_0 … x_n, at the borders of the control steps.
using Trajectory = std::vector<State>;

}  // namespace jostle
