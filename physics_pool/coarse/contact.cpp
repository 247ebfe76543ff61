#include "physics_pool/coarse/contact.hpp"

#include <algorithm>
#include <limits>

namespace jostle::physics_pool {
namespace {

using Eigen::Vector2d;

double reach(const Outline& outline) {
  return outline.radius > 0 ? outline.radius : std::hypot(outline.half_x, outline.half_y);
}

Contacts disc_contact(double radius, const Vector2d& centre, const Outline& other, const PlanarPose& pose,
                      double tolerance) {
  Contacts contacts;
  const Vector2d at = pose.rotate_back(centre - pose.place);
  const Nearest near = nearest(other, at.x(), at.y());
  const double depth = radius - near.distance;
  if (!(depth > tolerance)) return contacts;
  const Vector2d normal = pose.rotate(near.normal_x, near.normal_y);
  contacts.add({.point = centre - near.distance * normal, .normal = normal, .depth = depth});
  return contacts;
}

// The axis along which two boxes overlap least, seen from the box it belongs to.
struct Separation {
  double depth = std::numeric_limits<double>::infinity();
  Vector2d normal;  // outward from the reference box, towards the other
  bool reference_is_a = true;
};

void consider(const Outline& reference, const PlanarPose& at, const Outline& other, const PlanarPose& other_at,
              bool reference_is_a, Separation& least) {
  const Vector2d offset = other_at.place - at.place;
  for (const Vector2d& axis : {at.rotate(1, 0), at.rotate(0, 1)}) {
    const auto extent = [&axis](const Outline& shape, const PlanarPose& pose) {
      return shape.half_x * std::abs(axis.dot(pose.rotate(1, 0))) +
             shape.half_y * std::abs(axis.dot(pose.rotate(0, 1)));
    };
    const double depth = extent(reference, at) + extent(other, other_at) - std::abs(axis.dot(offset));
    if (!(depth < least.depth)) continue;
    least = {.depth = depth, .normal = axis.dot(offset) < 0 ? Vector2d(-axis) : axis, .reference_is_a = reference_is_a};
  }
}

// Separating axes, then the corners of the other box behind the reference's edge.
Contacts box_contacts(const Outline& a, const PlanarPose& pose_a, const Outline& b, const PlanarPose& pose_b,
                      double tolerance) {
  Separation least;
  consider(a, pose_a, b, pose_b, true, least);
  consider(b, pose_b, a, pose_a, false, least);
  Contacts contacts;
  if (!(least.depth > tolerance) || !std::isfinite(least.depth)) return contacts;
  const Outline& other = least.reference_is_a ? b : a;
  const PlanarPose& at = least.reference_is_a ? pose_b : pose_a;
  std::array<std::pair<double, Vector2d>, 4> corners;  // how deep, and where
  double deepest = -std::numeric_limits<double>::infinity();
  for (int i = 0; i < 4; ++i) {
    const Vector2d corner =
        at.place + at.rotate(i & 1 ? other.half_x : -other.half_x, i & 2 ? other.half_y : -other.half_y);
    corners[static_cast<std::size_t>(i)] = {-least.normal.dot(corner), corner};
    deepest = std::max(deepest, -least.normal.dot(corner));
  }
  std::ranges::sort(corners, [](const auto& x, const auto& y) { return x.first > y.first; });
  const Vector2d normal = least.reference_is_a ? Vector2d(-least.normal) : least.normal;  // from b to a
  for (int i = 0; i < 2; ++i) {
    const auto& [height, corner] = corners[static_cast<std::size_t>(i)];
    const double depth = least.depth - (deepest - height);
    if (depth > tolerance) contacts.add({.point = corner, .normal = normal, .depth = depth});
  }
  return contacts;
}

}  // namespace

Contacts find_contacts(const Outline& a, const PlanarPose& pose_a, const Outline& b, const PlanarPose& pose_b,
                       double tolerance) {
  const double range = reach(a) + reach(b);
  if (!((pose_a.place - pose_b.place).squaredNorm() <= range * range)) return {};
  if (a.radius > 0) return disc_contact(a.radius, pose_a.place, b, pose_b, tolerance);
  if (b.radius <= 0) return box_contacts(a, pose_a, b, pose_b, tolerance);
  Contacts flipped;
  for (Contact contact : disc_contact(b.radius, pose_b.place, a, pose_a, tolerance)) {
    contact.normal = -contact.normal;
    flipped.add(contact);
  }
  return flipped;
}

}  // namespace jostle::physics_pool
