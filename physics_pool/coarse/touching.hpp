#pragma once
/// \file
/// Where outlines in the plane are about to touch, or enter each other.

#include <Eigen/Core>
#include <array>

#include "physics_pool/coarse/contact.hpp"

namespace jostle::physics_pool {

/// A point where two outlines a and b touch, or will soon. `normal` points from b to a.
struct Touch {
  Eigen::Vector2d point{0.0, 0.0}, normal{1.0, 0.0};
  double gap = 0.0;  ///< m; negative: they overlap by so much
};

/// At most two, as two sides of boxes that face each other need.
struct Touches {
  std::array<Touch, 2> values;
  int count = 0;
};

/// Returns the farthest point of an outline from its centre, m.
double reach_of(const Outline& outline);

/// Finds the points where two outlines are less than `margin` metres apart. Unlike find_contacts it foresees contacts,
/// and cuts a side to what faces the other one, so that a short side against a long one turns nothing. Allocates
/// nothing.
Touches find_touches(const Outline& a, const PlanarPose& pose_a, const Outline& b, const PlanarPose& pose_b,
                     double margin);

}  // namespace jostle::physics_pool
