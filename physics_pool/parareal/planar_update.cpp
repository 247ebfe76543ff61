#include "physics_pool/parareal/planar_update.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace jostle::physics_pool {
namespace {

constexpr double kFallen = 0.1;  // m below the resting height

double difference(double a, double b) { return std::remainder(a - b, 2 * std::numbers::pi); }

}  // namespace

PlanarUpdate::PlanarUpdate(const Scene& scene)
    : layout_(layout_of(scene)),
      surface_(scene.surface),
      pusher_{.radius = disc_radius(scene.robot.model).value_or(0.0)} {
  for (const SceneObject& object : scene.objects) {
    outlines_.push_back(outline(object));
    rest_heights_.push_back(object.rest_height());
  }
}

void PlanarUpdate::displace(State& x, std::size_t slider, double dx, double dy, double turn) const {
  double* const q = &x.q[static_cast<std::size_t>(layout_.objects[slider].q)];
  q[0] += dx;
  q[1] += dy;
  if (turn == 0.0) return;
  // About the vertical through the centre: a quaternion from the left.
  const double c = std::cos(turn / 2), s = std::sin(turn / 2);
  const double w = q[3], i = q[4], j = q[5], k = q[6];
  q[3] = c * w - s * k;
  q[4] = c * i - s * j;
  q[5] = c * j + s * i;
  q[6] = c * k + s * w;
}

void PlanarUpdate::replace(State& x, std::span<const double> planar) const {
  const PlanarLayout at = planar_layout();
  std::copy_n(planar.begin(), 2, x.q.begin());
  std::copy_n(planar.begin() + at.pusher_velocity(), 2, x.v.begin());
  for (int i = 0; i < at.sliders; ++i) {
    const auto slider = static_cast<std::size_t>(i);
    double* const q = &x.q[static_cast<std::size_t>(layout_.objects[slider].q)];
    double* const v = &x.v[static_cast<std::size_t>(layout_.objects[slider].v)];
    const double* pose = &planar[static_cast<std::size_t>(at.pose(i))];
    const double* velocity = &planar[static_cast<std::size_t>(at.velocity(i))];
    const double turn = difference(pose[2], yaw_of(q + 3));
    displace(x, slider, pose[0] - q[0], pose[1] - q[1], turn);
    if (!surface_.carries(q[0], q[1])) q[2] = std::min(q[2], rest_heights_[slider] - kFallen);
    std::fill_n(v, 6, 0.0);
    std::copy_n(velocity, 2, v);
    v[5] = velocity[2];
  }
}

// A turn by one radian moves the border by so much, m.
double PlanarUpdate::reach(std::size_t slider) const {
  const Outline& shape = outlines_[slider];
  return shape.radius > 0 ? shape.radius : std::hypot(shape.half_x, shape.half_y);
}

void PlanarUpdate::correct(State& x, const Step& now, const Step& before, double limit) const {
  const PlanarLayout at = planar_layout();
  const auto minus = [](std::span<const double> a, std::span<const double> b, int i) {
    return a[static_cast<std::size_t>(i)] - b[static_cast<std::size_t>(i)];
  };
  const auto moved = [&](int i) { return minus(now.end, before.end, i); };
  for (int axis = 0; axis < 2; ++axis) {
    x.q[static_cast<std::size_t>(axis)] += moved(axis);
    x.v[static_cast<std::size_t>(axis)] += moved(at.pusher_velocity() + axis);
  }
  const double pusher = std::hypot(minus(now.start, before.start, 0), minus(now.start, before.start, 1));
  for (int i = 0; i < at.sliders; ++i) {
    const auto slider = static_cast<std::size_t>(i);
    const int p = at.pose(i), d = at.velocity(i);
    const auto size = [&](std::span<const double> a, std::span<const double> b) {
      return std::hypot(minus(a, b, p), minus(a, b, p + 1)) +
             reach(slider) * std::abs(std::remainder(minus(a, b, p + 2), 2 * std::numbers::pi));
    };
    const double correction = size(now.end, before.end);
    const double allowed = limit * (size(now.start, before.start) + pusher);
    const double share = correction > allowed ? allowed / correction : 1.0;
    displace(x, slider, share * moved(p), share * moved(p + 1),
             share * std::remainder(moved(p + 2), 2 * std::numbers::pi));
    double* const v = &x.v[static_cast<std::size_t>(layout_.objects[slider].v)];
    v[0] += share * moved(d);
    v[1] += share * moved(d + 1);
    v[5] += share * moved(d + 2);
  }
}

void PlanarUpdate::project(State& x) const {
  constexpr int kSweeps = 50;
  const PlanarPose pusher(x.q[0], x.q[1], 0.0);
  const auto pose = [&](std::size_t i) {
    const double* q = &x.q[static_cast<std::size_t>(layout_.objects[i].q)];
    return PlanarPose(q[0], q[1], yaw_of(q + 3));
  };
  const auto stands = [&](std::size_t i) {
    return x.q[static_cast<std::size_t>(layout_.objects[i].q) + 2] > rest_heights_[i] - kFallen / 2;
  };
  const auto deepest = [](const Contacts& contacts) {
    return std::max_element(contacts.begin(), contacts.end(),
                            [](const Contact& a, const Contact& b) { return a.depth < b.depth; });
  };
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    bool moved = false;
    for (std::size_t i = 0; i < outlines_.size(); ++i) {
      if (!stands(i)) continue;
      for (std::size_t j = 0; j < i; ++j) {
        if (!stands(j)) continue;
        const Contacts contacts = find_contacts(outlines_[i], pose(i), outlines_[j], pose(j), kTolerance);
        if (contacts.empty()) continue;
        const Contact& contact = *deepest(contacts);
        const Eigen::Vector2d way = contact.normal * contact.depth / 2;
        displace(x, i, way.x(), way.y(), 0.0);
        displace(x, j, -way.x(), -way.y(), 0.0);
        moved = true;
      }
      const Contacts contacts = find_contacts(outlines_[i], pose(i), pusher_, pusher, kTolerance);
      if (contacts.empty()) continue;
      const Eigen::Vector2d way = contacts.begin()->normal * contacts.begin()->depth;
      displace(x, i, way.x(), way.y(), 0.0);
      moved = true;
    }
    if (!moved) return;
  }
}

PlanarUpdate::Change PlanarUpdate::change(const State& a, const State& b) const {
  Change largest;
  for (const ObjectSlot& slot : layout_.objects) {
    const double* p = &a.q[static_cast<std::size_t>(slot.q)];
    const double* q = &b.q[static_cast<std::size_t>(slot.q)];
    largest.translation = std::max(largest.translation, std::hypot(p[0] - q[0], p[1] - q[1]));
    largest.rotation = std::max(largest.rotation, std::abs(difference(yaw_of(p + 3), yaw_of(q + 3))));
  }
  return largest;
}

}  // namespace jostle::physics_pool
