#include "physics_pool/coarse/touching.hpp"

#include <algorithm>
#include <cmath>

namespace jostle::physics_pool {
namespace {

using Eigen::Vector2d;

// A disc a against any outline b.
void touch_disc(double radius, const Vector2d& centre, const Outline& b, const PlanarPose& pose, double margin,
                Touches& touches) {
  const Vector2d at = pose.rotate_back(centre - pose.place);
  const Nearest near = nearest(b, at.x(), at.y());
  const double gap = near.distance - radius;
  if (!(gap < margin)) return;
  const Vector2d normal = pose.rotate(near.normal_x, near.normal_y);
  touches.values[static_cast<std::size_t>(touches.count++)] = {
      .point = centre - near.distance * normal, .normal = normal, .gap = gap};
}

// A side of the box `reference` that another box is in front of.
struct Side {
  double gap = -std::numeric_limits<double>::infinity();
  bool along_x = true;  // the side's normal is the box's x axis, or its y axis
  double sign = 1.0;
};

// The side of `box` from which `other`, whose centre is at `centre` in the box's frame and whose axes are turned
// against the box's by an angle of this cosine and sine, is farthest away.
Side farthest_side(const Outline& box, const Outline& other, const Vector2d& centre, double cosine, double sine) {
  const double c = std::abs(cosine), s = std::abs(sine);
  const double x = std::abs(centre.x()) - box.half_x - other.half_x * c - other.half_y * s;
  const double y = std::abs(centre.y()) - box.half_y - other.half_x * s - other.half_y * c;
  if (x >= y) return {.gap = x, .along_x = true, .sign = centre.x() < 0 ? -1.0 : 1.0};
  return {.gap = y, .along_x = false, .sign = centre.y() < 0 ? -1.0 : 1.0};
}

// The ends of the other box's nearest side, cut to the width of the reference's side. `flip`: the reference is a.
void touch_side(const Outline& reference, const PlanarPose& at, const Side& side, const Outline& other,
                const PlanarPose& other_at, double margin, bool flip, Touches& touches) {
  const Vector2d normal = side.along_x ? Vector2d(side.sign, 0) : Vector2d(0, side.sign);
  const Vector2d towards = other_at.rotate_back(at.rotate(normal.x(), normal.y()));  // in the other's frame
  Vector2d p, q;
  if (std::abs(towards.x()) > std::abs(towards.y())) {
    const double x = std::copysign(other.half_x, -towards.x());
    p = {x, other.half_y}, q = {x, -other.half_y};
  } else {
    const double y = std::copysign(other.half_y, -towards.y());
    p = {other.half_x, y}, q = {-other.half_x, y};
  }
  const auto here = [&](const Vector2d& v) {
    return at.rotate_back(other_at.place + other_at.rotate(v.x(), v.y()) - at.place);
  };
  p = here(p), q = here(q);
  const int across = side.along_x ? 1 : 0;
  const double half = side.along_x ? reference.half_y : reference.half_x;
  const double front = side.along_x ? reference.half_x : reference.half_y;
  const auto cut = [&](double border, double sign) {
    const double dp = sign * p[across] - border, dq = sign * q[across] - border;
    if (dp <= 0 && dq <= 0) return true;
    if (dp > 0 && dq > 0) return false;
    const Vector2d middle = p + (q - p) * (dp / (dp - dq));
    (dp > 0 ? p : q) = middle;
    return true;
  };
  if (!cut(half, 1.0) || !cut(half, -1.0)) return;
  const Vector2d n = at.rotate(normal.x(), normal.y());
  for (const Vector2d& v : {p, q}) {
    const double gap = normal.dot(v) - front;
    if (!(gap < margin)) continue;
    touches.values[static_cast<std::size_t>(touches.count++)] = {
        .point = at.place + at.rotate(v.x(), v.y()), .normal = flip ? Vector2d(-n) : n, .gap = gap};
  }
}

}  // namespace

double reach_of(const Outline& outline) {
  return outline.radius > 0 ? outline.radius : std::hypot(outline.half_x, outline.half_y);
}

Touches find_touches(const Outline& a, const PlanarPose& pose_a, const Outline& b, const PlanarPose& pose_b,
                     double margin) {
  Touches touches;
  if (a.radius > 0) {
    touch_disc(a.radius, pose_a.place, b, pose_b, margin, touches);
    return touches;
  }
  if (b.radius > 0) {
    touch_disc(b.radius, pose_b.place, a, pose_a, margin, touches);
    for (int i = 0; i < touches.count; ++i) {
      Vector2d& normal = touches.values[static_cast<std::size_t>(i)].normal;
      normal = -normal;
    }
    return touches;
  }
  const Vector2d way = pose_b.place - pose_a.place;
  const double cosine = pose_a.cosine * pose_b.cosine + pose_a.sine * pose_b.sine;
  const double sine = pose_a.cosine * pose_b.sine - pose_a.sine * pose_b.cosine;
  const Side of_a = farthest_side(a, b, pose_a.rotate_back(way), cosine, sine);
  if (!(of_a.gap < margin)) return touches;
  const Side of_b = farthest_side(b, a, pose_b.rotate_back(-way), cosine, sine);
  if (!(of_b.gap < margin)) return touches;
  // Where both are nearly as far the choice must not flip from step to step.
  constexpr double kPreference = 1e-4;  // m
  if (of_a.gap > of_b.gap - kPreference) {
    touch_side(a, pose_a, of_a, b, pose_b, margin, true, touches);
  } else {
    touch_side(b, pose_b, of_b, a, pose_a, margin, false, touches);
  }
  return touches;
}

}  // namespace jostle::physics_pool
