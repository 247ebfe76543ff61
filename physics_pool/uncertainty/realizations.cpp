#include "physics_pool/uncertainty/realizations.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::physics_pool {
namespace {

constexpr std::uint32_t kRealizationStream = 0x9a11, kStartStream = 0x9a12;
constexpr double kTouching = -0.0005;  // m; bodies in contact are a little in each other, cf. separate()
constexpr double kStanding = 0.99;     // cosine of the tilt, 8 degrees
constexpr int kTries = 20;             // the last one differs by 1 % of the draw
constexpr double kShrink = 0.8;

// Uniform in [-1, 1].
double either_way(std::uint64_t seed, const DrawIndex& index) { return 2 * standard_uniform(seed, index) - 1; }

double between(double low, double high, std::uint64_t seed, const DrawIndex& index) {
  return low + (high - low) * standard_uniform(seed, index);
}

// Replaces objects[i] by the largest share of a change that leaves it free. `change(share)`: the changed object.
template <class Change>
void change_as_far_as_free(Scene& scene, std::size_t i, double gap, Change change) {
  scene.objects.erase(scene.objects.begin() + static_cast<std::ptrdiff_t>(i));  // nothing is in its own way
  SceneObject found = change(0.0);
  double share = 1.0;
  for (int k = 0; k < kTries; ++k, share *= kShrink) {
    SceneObject tried = change(share);
    if (!is_free(scene, tried, gap) || !scene.surface.carries(tried.x, tried.y)) continue;
    found = std::move(tried);
    break;
  }
  scene.objects.insert(scene.objects.begin() + static_cast<std::ptrdiff_t>(i), std::move(found));
}

std::array<double, 4> product(const std::array<double, 4>& a, const double* b) {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

}  // namespace

Scene realize(const Scene& nominal, const ParameterBounds& bounds, std::uint64_t seed, int world) {
  Scene scene = nominal;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const auto draw = [&](std::uint32_t axis) {
      return DrawIndex{.stream = kRealizationStream,
                       .sample = static_cast<std::uint32_t>(world),
                       .step = static_cast<std::uint32_t>(i),
                       .axis = axis};
    };
    const SceneObject believed = nominal.objects[i];
    change_as_far_as_free(scene, i, 0.0, [&](double share) {
      SceneObject object = believed;
      object.mass = between(bounds.least_mass, bounds.most_mass, seed, draw(0));
      object.friction = between(bounds.least_friction, bounds.most_friction, seed, draw(1));
      std::uint32_t axis = 2;
      if (!object.parts.empty()) {
        const double reach = object.reach();
        object.scale(std::max(1 + share * bounds.size * either_way(seed, draw(axis)) / reach, 0.5));
        return object;
      }
      for (double* extent : {&object.size[0], &object.size[1], &object.size[2], &object.radius, &object.height}) {
        *extent = std::max(*extent + share * bounds.size * either_way(seed, draw(axis++)), *extent / 2);
      }
      if (object.shape == Shape::kBox) {
        object.radius = object.height = 0.0;
      } else {
        object.size = {};
      }
      return object;
    });
  }
  return scene;
}

State nearby_start(const Scene& nominal, const Scene& world, const State& x0, const StartSpread& spread,
                   std::uint64_t seed, int start) {
  const StateLayout layout = layout_of(nominal);
  Scene scene = world;  // as it is at x0
  std::copy_n(x0.q.begin(), layout.joints.size(), scene.robot.q.begin());
  for (std::size_t i = 0; i < layout.objects.size(); ++i) {
    const ObjectView seen(layout.objects[i], x0);
    scene.objects[i].x = seen.position()[0];
    scene.objects[i].y = seen.position()[1];
    scene.objects[i].yaw = seen.yaw();
  }
  State x = x0;
  for (std::size_t i = 0; i < layout.objects.size(); ++i) {
    const auto q = static_cast<std::size_t>(layout.objects[i].q);
    x.q[q + 2] += world.objects[i].rest_height() - nominal.objects[i].rest_height();
    if (ObjectView(layout.objects[i], x0).uprightness() < kStanding) continue;
    const auto draw = [&](std::uint32_t axis) {
      return standard_normal(seed, {.stream = kStartStream,
                                    .sample = static_cast<std::uint32_t>(start),
                                    .step = static_cast<std::uint32_t>(i),
                                    .axis = axis});
    };
    const SceneObject before = scene.objects[i];
    change_as_far_as_free(scene, i, kTouching, [&](double share) {
      SceneObject object = before;
      object.x += share * spread.position * draw(0);
      object.y += share * spread.position * draw(1);
      object.yaw += share * spread.rotation * draw(2);
      return object;
    });
    x.q[q] = scene.objects[i].x;
    x.q[q + 1] = scene.objects[i].y;
    const auto turned = product(turned_about_z(scene.objects[i].yaw - before.yaw), &x0.q[q + 3]);
    std::ranges::copy(turned, x.q.begin() + static_cast<std::ptrdiff_t>(q) + 3);
  }
  return x;
}

}  // namespace jostle::physics_pool
