#include "physics_pool/task/state_distance.hpp"

#include <algorithm>
#include <cmath>

namespace jostle::physics_pool {
namespace {

constexpr double kLever = 0.1;  // m, of control_norm

// Where a body's z axis points.
std::array<double, 3> upright_axis(const double* q) {
  return {2 * (q[1] * q[3] + q[0] * q[2]), 2 * (q[2] * q[3] - q[0] * q[1]), uprightness(q)};
}

double angle_between_axes(const double* a, const double* b) {
  const auto u = upright_axis(a), v = upright_axis(b);
  const double dot = u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
  const std::array<double, 3> cross{u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]};
  return std::atan2(std::hypot(cross[0], cross[1], cross[2]), dot);
}

double squared_distance_of(const TaskGeometry& geometry, const double* a, const double* b, std::size_t i) {
  const double x = a[0] - b[0], y = a[1] - b[1], z = a[2] - b[2];
  const double angle = geometry.round[i] ? angle_between_axes(a + 3, b + 3) : angle_between(a + 3, b + 3);
  const double arc = geometry.footprints[i] * angle;
  return x * x + y * y + z * z + arc * arc;
}

double squared_distance_of(const TaskGeometry& geometry, std::span<const double> a, std::span<const double> b,
                           std::size_t i) {
  const auto q = static_cast<std::size_t>(geometry.layout.objects[i].q);
  return squared_distance_of(geometry, &a[q], &b[q], i);
}

}  // namespace

double objects_distance(const TaskGeometry& geometry, std::span<const double> a, std::span<const double> b,
                        std::span<const int> objects) {
  double sum = 0.0;
  for (const int i : objects) sum += squared_distance_of(geometry, a, b, static_cast<std::size_t>(i));
  return std::sqrt(sum);
}

double state_distance(const TaskGeometry& geometry, std::span<const double> a, std::span<const double> b) {
  double sum = 0.0;
  for (std::size_t j = 0; j < geometry.layout.joints.size(); ++j) {
    const double way = (a[j] - b[j]) * (geometry.robot.joints[j].kind == JointKind::kHinge ? kLever : 1.0);
    sum += way * way;
  }
  for (std::size_t i = 0; i < geometry.layout.objects.size(); ++i) sum += squared_distance_of(geometry, a, b, i);
  return std::sqrt(sum);
}

}  // namespace jostle::physics_pool
