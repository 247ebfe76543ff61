#pragma once
/// \file
/// Where outlines in the plane enter each other.

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <span>

#include "physics_pool/scene/outline.hpp"

namespace jostle::physics_pool {

/// Pose of an outline's frame in the world's plane.
struct PlanarPose {
  PlanarPose() = default;
  PlanarPose(double x, double y, double theta) : place(x, y) { turn_to(theta); }

  void turn_to(double theta) {
    turn = theta;
    cosine = std::cos(theta);
    sine = std::sin(theta);
  }
  Eigen::Vector2d rotate(double x, double y) const { return {cosine * x - sine * y, sine * x + cosine * y}; }
  Eigen::Vector2d rotate_back(const Eigen::Vector2d& v) const {
    return {cosine * v.x() + sine * v.y(), -sine * v.x() + cosine * v.y()};
  }

  Eigen::Vector2d place{0.0, 0.0};  // m
  double turn = 0.0;                // rad
  double cosine = 1.0, sine = 0.0;
};

/// A point where two outlines a and b overlap. `normal` points from b to a: moving a by
/// depth·normal ends the overlap there.
struct Contact {
  Eigen::Vector2d point, normal;
  double depth = 0.0;  // m, > 0
};

/// The contacts of two outlines, at most two: a disc has one, boxes that meet along an edge have two.
class Contacts {
 public:
  void add(const Contact& contact) { values_[count_++] = contact; }
  const Contact* begin() const { return values_.data(); }
  const Contact* end() const { return values_.data() + count_; }
  bool empty() const { return count_ == 0; }

 private:
  std::array<Contact, 2> values_;
  std::size_t count_ = 0;
};

/// Finds the contacts of two outlines that overlap by more than `tolerance` metres. Empty for others, and
/// for poses that are not finite.
Contacts find_contacts(const Outline& a, const PlanarPose& pose_a, const Outline& b, const PlanarPose& pose_b,
                       double tolerance = 0.0);

}  // namespace jostle::physics_pool
