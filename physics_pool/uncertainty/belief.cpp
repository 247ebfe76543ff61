#include "physics_pool/uncertainty/belief.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::physics_pool {
namespace {

constexpr std::uint32_t kPerturbStream = 0x9e57;

// Footnote 2 of Ch. 3, low uncertainty.
constexpr double kPositionSigma = 0.005;  // m
constexpr double kYawSigma = 0.005;       // rad
constexpr double kSizeSigma = 0.005;      // m
constexpr double kMassSigma = 0.01;       // kg
constexpr double kFrictionSigma = 0.005;

double scale_of(Uncertainty level) { return static_cast<int>(level); }  // 0, 1, 2, 3

// A belief of everything in the scene; nothing if an object found no free place
// because those before it are believed to be where it is.
std::optional<Scene> draw_belief(const Scene& execution, double scale, CounterStream& random) {
  Scene belief = execution;
  belief.objects.clear();
  for (const SceneObject& truth : execution.objects) {
    SceneObject object;
    // Less noise after every draw that does not fit, so that the loop ends.
    double shrink = 1.0;
    do {
      const auto noisy = [&](double value, double sigma, double least) {
        return std::max(random.normal(value, shrink * scale * sigma), least);
      };
      const Rectangle bounds = execution.surface.bounds();
      object = truth;
      if (object.parts.empty()) {
        for (double& extent : object.size) extent = noisy(extent, kSizeSigma, extent / 2);
        object.radius = noisy(object.radius, kSizeSigma, object.radius / 2);
        object.height = noisy(object.height, kSizeSigma, object.height / 2);
      } else {
        const double reach = object.reach();
        object.scale(noisy(reach, kSizeSigma, reach / 2) / reach);
      }
      object.mass = noisy(object.mass, kMassSigma, object.mass / 2);
      object.friction = noisy(object.friction, kFrictionSigma, object.friction / 2);
      object.x = std::clamp(noisy(object.x, kPositionSigma, bounds.low_x()), bounds.low_x(), bounds.high_x());
      object.y = std::clamp(noisy(object.y, kPositionSigma, bounds.low_y()), bounds.low_y(), bounds.high_y());
      object.yaw = random.normal(object.yaw, shrink * scale * kYawSigma);
      shrink *= 0.98;
    } while (shrink > 1e-3 && !(is_free(belief, object, 0.0) && belief.surface.carries(object.x, object.y)));
    if (!(is_free(belief, object, 0.0) && belief.surface.carries(object.x, object.y))) return std::nullopt;
    belief.objects.push_back(object);
  }
  return belief;
}

}  // namespace

Scene perturb(const Scene& execution, Uncertainty level, std::uint64_t seed) {
  if (level == Uncertainty::kNone) return execution;
  CounterStream random(seed, kPerturbStream);
  // Begins again with less noise; without any, the truth itself fits.
  for (double scale = scale_of(level); scale > 1e-6; scale *= 0.95) {
    if (auto belief = draw_belief(execution, scale, random)) return *belief;
  }
  return execution;
}

State observed_state(const Scene& execution, const Scene& belief, const State& truth, Measurement measurement) {
  State seen = truth;
  const StateLayout layout = layout_of(execution);
  const State start = initial_state(belief);
  for (std::size_t i = 0; i < layout.objects.size(); ++i) {
    const int q = layout.objects[i].q;
    if (measurement == Measurement::kInitial) {
      std::copy_n(start.q.begin() + q, 7, seen.q.begin() + q);
    } else {
      seen.q[static_cast<std::size_t>(q) + 2] += belief.objects[i].rest_height() - execution.objects[i].rest_height();
    }
  }
  return seen;
}

Result<void> check_belief(const Scene& execution, const Scene& belief) {
  if (belief.robot.model != execution.robot.model) {
    return invalid("robot", fmt::format("'{}'", belief.robot.model.name),
                   fmt::format("the robot '{}' of scene '{}'", execution.robot.model.name, execution.name));
  }
  const auto names = [](const Scene& scene) {
    std::vector<std::string> result;
    for (const SceneObject& object : scene.objects) result.push_back(object.name);
    return result;
  };
  if (names(belief) == names(execution)) return {};
  return invalid(
      "objects", fmt::format("{}", fmt::join(names(belief), ", ")),
      fmt::format("those of scene '{}' in its order: {}", execution.name, fmt::join(names(execution), ", ")));
}

}  // namespace jostle::physics_pool
