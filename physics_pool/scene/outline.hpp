#pragma once
/// \file
/// Outlines of objects in the surface's plane.

#include <algorithm>
#include <cmath>

#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

/// A rectangle about the origin with sides along the axes, or a disc where radius > 0.
struct Outline {
  double half_x = 0.0, half_y = 0.0, radius = 0.0;  // m
};

inline Outline outline(const SceneObject& object) {
  if (object.shape == Shape::kCylinder) return {.radius = object.radius};
  return {.half_x = object.size[0] / 2, .half_y = object.size[1] / 2};
}

/// How far a point is from the nearest point of an outline's border, and the
/// outward normal there. Inside, the distance is negative.
struct Nearest {
  double distance = 0.0;  // m
  double normal_x = 1.0, normal_y = 0.0;
};

/// Finds it for the point (x, y) in the outline's frame.
inline Nearest nearest(const Outline& outline, double x, double y) {
  if (outline.radius > 0) {
    const double range = std::hypot(x, y);
    if (range == 0) return {.distance = -outline.radius};
    return {.distance = range - outline.radius, .normal_x = x / range, .normal_y = y / range};
  }
  const double along = std::abs(x) - outline.half_x, across = std::abs(y) - outline.half_y;
  if (along > 0 && across > 0) {  // beyond a corner
    const double range = std::hypot(along, across);
    return {
        .distance = range, .normal_x = std::copysign(along / range, x), .normal_y = std::copysign(across / range, y)};
  }
  if (along > across) return {.distance = along, .normal_x = std::copysign(1.0, x), .normal_y = 0.0};
  return {.distance = across, .normal_x = 0.0, .normal_y = std::copysign(1.0, y)};
}

}  // namespace jostle::physics_pool
