#include "robot_bridge/ur/arm_shapes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace jostle::robot_bridge::ur {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Vector3d;

constexpr double kRight = std::numbers::pi / 2;

Isometry3d at(double x, double y, double z) { return Isometry3d(Eigen::Translation3d(x, y, z)); }
Isometry3d about_x(double angle) { return Isometry3d(AngleAxisd(angle, Vector3d::UnitX())); }
Isometry3d about_z(double angle) { return Isometry3d(AngleAxisd(angle, Vector3d::UnitZ())); }

// Ends of a cylinder between two places of an axis, rounded off within it.
Capsule along_z(double low, double high, double radius) {
  return {{0, 0, std::min(low + radius, high)}, {0, 0, std::max(high - radius, low)}, radius};
}
Capsule along_y(double low, double high, double radius) {
  return {{0, std::min(low + radius, high), 0}, {0, std::max(high - radius, low), 0}, radius};
}

// Parts that may come near each other, though joints lie between them.
bool may_meet(Part a, Part b) {
  const int apart = static_cast<int>(b) - static_cast<int>(a);
  if (a >= Part::kForearm) return false;  // the wrists' ranges overlap by their shape, and never touch
  return apart >= (a == Part::kBase ? 3 : 2);
}

double to_box(const Vector3d& p, const Vector3d& half) { return (p.cwiseAbs() - half).cwiseMax(0.0).norm(); }

}  // namespace

const char* to_string(Part part) {
  constexpr std::array kNames{"base", "shoulder", "upper arm", "forearm", "wrist 1", "wrist 2", "wrist 3", "gripper"};
  return kNames[static_cast<std::size_t>(part)];
}

std::vector<PartShape> arm_shapes(const Joints& q) {
  const Isometry3d shoulder = at(0, 0, 0.089159) * about_z(q[0]);
  const Isometry3d upper = shoulder * about_x(kRight) * about_z(q[1]);
  const Isometry3d forearm = upper * at(-0.425, 0, 0) * about_z(q[2]);
  const Isometry3d wrist1 = forearm * at(-0.39225, 0, 0.10915) * about_z(q[3]);
  const Isometry3d wrist2 = wrist1 * at(0, -0.09465, 0) * about_x(kRight) * about_z(q[4]);
  const Isometry3d flange = flange_pose(Dh::ur5(), q);  // its z axis leaves the last wrist
  std::vector<PartShape> shapes;
  const auto add = [&](Part part, const Isometry3d& X_BL, const Capsule& capsule) {
    shapes.push_back({part, {X_BL * capsule.a, X_BL * capsule.b, capsule.radius}});
  };
  add(Part::kBase, Isometry3d::Identity(), {{0, 0, 0}, {0, 0, 0}, 0.075});
  add(Part::kShoulder, shoulder, along_z(-0.065, 0.068, 0.06));
  add(Part::kUpperArm, upper, {{0, 0, 0.136}, {-0.425, 0, 0.136}, 0.06});
  // It tapers from 58 to 45 mm: four pieces, each as thick as its thicker end.
  constexpr int kPieces = 4;
  for (int i = 0; i < kPieces; ++i) {
    const double begin = -0.392 * i / kPieces, end = -0.392 * (i + 1) / kPieces;
    add(Part::kForearm, forearm, {{begin, 0, 0.0165}, {end, 0, 0.0165}, 0.058 - 0.013 * i / kPieces});
  }
  add(Part::kWrist1, wrist1, along_z(-0.046, 0.040, 0.04));
  add(Part::kWrist1, wrist1, along_y(-0.048, 0.057, 0.04));
  add(Part::kWrist2, wrist2, along_z(-0.046, 0.038, 0.04));
  add(Part::kWrist2, wrist2, along_y(-0.057, 0.048, 0.04));
  add(Part::kWrist3, flange, along_z(-0.035, 0.0, 0.038));
  add(Part::kGripper, flange, along_z(0.0, 0.163, 0.045));
  return shapes;
}

// The nearest points of two segments a + s u and b + t v: s and t are those of the lines, kept within 0 to 1, each in
// turn, from both ends.
double distance(const Capsule& a, const Capsule& b) {
  const Vector3d u = a.b - a.a, v = b.b - b.a, w = a.a - b.a;
  const double uu = u.squaredNorm(), vv = v.squaredNorm(), uv = u.dot(v);
  const double denominator = uu * vv - uv * uv;
  const auto along = [](double way, double square) { return square > 0 ? std::clamp(way / square, 0.0, 1.0) : 0.0; };
  double s = denominator > 1e-12 * uu * vv ? std::clamp((uv * v.dot(w) - vv * u.dot(w)) / denominator, 0.0, 1.0) : 0.0;
  const double t = along(v.dot(w + s * u), vv);
  s = along(u.dot(t * v - w), uu);
  return (w + s * u - t * v).norm() - a.radius - b.radius;
}

// Along a segment the distance to a convex body is convex: a search by thirds finds its least value.
double distance(const Capsule& capsule, const Obstacle& obstacle) {
  const Isometry3d X_FW = obstacle.X_WF.inverse();
  const Vector3d a = X_FW * capsule.a, b = X_FW * capsule.b;
  const auto at_share = [&](double s) { return to_box(a + s * (b - a), obstacle.half); };
  double low = 0.0, high = 1.0;
  constexpr int kSteps = 40;  // to 1e-7 of the length
  for (int i = 0; i < kSteps; ++i) {
    const double first = low + (high - low) / 3, second = high - (high - low) / 3;
    (at_share(first) <= at_share(second) ? high : low) = at_share(first) <= at_share(second) ? second : first;
  }
  return at_share(0.5 * (low + high)) - capsule.radius;
}

std::optional<std::string> touched(const Joints& q, const Isometry3d& X_WB, std::span<const Obstacle> obstacles) {
  const std::vector<PartShape> shapes = arm_shapes(q);
  for (std::size_t i = 0; i < shapes.size(); ++i) {
    for (std::size_t k = i + 1; k < shapes.size(); ++k) {
      if (!may_meet(shapes[i].part, shapes[k].part) || distance(shapes[i].capsule, shapes[k].capsule) >= 0) continue;
      return fmt::format("the arm's {} would touch its {}", to_string(shapes[k].part), to_string(shapes[i].part));
    }
  }
  for (const PartShape& shape : shapes) {
    const Capsule placed{X_WB * shape.capsule.a, X_WB * shape.capsule.b, shape.capsule.radius};
    if (shape.part > Part::kShoulder && std::min(placed.a.z(), placed.b.z()) < placed.radius) {
      return fmt::format("the arm's {} would touch the surface", to_string(shape.part));
    }
    if (shape.part == Part::kBase) continue;  // it stands where it was put
    for (const Obstacle& obstacle : obstacles) {
      if (distance(placed, obstacle) >= 0) continue;
      return fmt::format("the arm's {} would touch '{}'", to_string(shape.part), obstacle.name);
    }
  }
  return {};
}

}  // namespace jostle::robot_bridge::ur
