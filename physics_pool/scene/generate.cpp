#include "physics_pool/scene/generate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::physics_pool {
namespace {

constexpr std::uint32_t kSceneStream = 0x5ce4e;
constexpr std::uint32_t kPerturbStream = 0x9e57;
constexpr int kPlacementTries = 20000;

constexpr double kTable = 0.6, kLargestTable = 2.0;  // m, side
constexpr int kThesisObjects = 15;                   // on the smaller one
constexpr double kStart = -0.33;                     // m, of the hand before the smaller one

// Footnote 2 of Ch. 3, low uncertainty.
constexpr double kPositionSigma = 0.005;  // m
constexpr double kYawSigma = 0.005;       // rad
constexpr double kSizeSigma = 0.005;      // m
constexpr double kMassSigma = 0.01;       // kg
constexpr double kFrictionSigma = 0.005;

double scale_of(Uncertainty level) { return static_cast<int>(level); }  // 0, 1, 2, 3

void draw_body(CounterStream& random, SceneObject& object) {
  if (object.shape == Shape::kBox) {
    object.size = {random.uniform(0.03, 0.05), random.uniform(0.03, 0.05), random.uniform(0.036, 0.04)};
  } else {
    object.radius = random.uniform(0.035, 0.04);
    object.height = random.uniform(0.04, 0.055);
  }
  object.mass = random.uniform(0.2, 0.8);
  object.friction = random.uniform(0.2, 0.6);
}

bool is_free(const Scene& scene, const SceneObject& object, double gap) {
  return !overlaps_robot(scene, object, gap) &&
         std::ranges::none_of(scene.objects, [&](const SceneObject& other) { return overlap(object, other, gap); });
}

}  // namespace

Result<Scene> generate_chapter3(const GenerateOptions& options) {
  if (options.objects < 0 || options.objects > 40) {
    return Error{Code::kInvalidArgument, fmt::format("objects: got {}, wanted 0 to 40", options.objects)};
  }
  const double side = options.table != 0
                          ? options.table
                          : kTable * std::sqrt(std::max(options.objects, kThesisObjects) / double{kThesisObjects});
  if (!(side >= kTable && side <= kLargestTable)) {
    return Error{Code::kInvalidArgument,
                 fmt::format("table: got {} m, wanted {} to {} m", side, kTable, kLargestTable)};
  }
  CounterStream random(options.seed, kSceneStream);
  Scene scene;
  scene.name = fmt::format("chapter3-{}-{}", options.objects, options.seed);
  scene.surface.size = {side, side};
  scene.robot = {.x = kStart - (side - kTable) / 2, .y = 0.0, .rotation = 0.0, .opening = 0.085};
  scene.task = {.kind = "grasp", .target = "target"};

  SceneObject target{.name = "target", .shape = Shape::kBox};
  draw_body(random, target);
  target.x = random.normal(0.0, 0.01);
  target.y = random.normal(0.0, 0.01);
  target.yaw = random.uniform(-std::numbers::pi, std::numbers::pi);

  scene.objects.push_back(target);
  const double reach_x = scene.surface.size[0] / 2 - options.edge_distance;
  const double reach_y = scene.surface.size[1] / 2 - options.edge_distance;
  for (int i = 0; i < options.objects; ++i) {
    SceneObject object{.name = fmt::format("object{}", i + 1), .shape = random.coin() ? Shape::kBox : Shape::kCylinder};
    draw_body(random, object);
    int tries = 0;
    do {
      if (++tries > kPlacementTries) {
        return Error{Code::kInvalidArgument,
                     fmt::format("objects: no free place left for number {} of {}; wanted fewer "
                                 "objects or another seed than {}",
                                 i + 1, options.objects, options.seed)};
      }
      object.x = random.uniform(-reach_x, reach_x);
      object.y = random.uniform(-reach_y, reach_y);
      object.yaw = random.uniform(-std::numbers::pi, std::numbers::pi);
    } while (!is_free(scene, object, options.gap));
    scene.objects.push_back(object);
  }
  return scene;
}

namespace {

constexpr std::array<std::pair<const char*, Uncertainty>, 4> kLevels{{{"none", Uncertainty::kNone},
                                                                      {"low", Uncertainty::kLow},
                                                                      {"medium", Uncertainty::kMedium},
                                                                      {"high", Uncertainty::kHigh}}};

}  // namespace

Result<Uncertainty> parse_uncertainty(std::string_view word) {
  for (const auto& [name, level] : kLevels) {
    if (word == name) return level;
  }
  return Error{Code::kInvalidArgument, fmt::format("uncertainty: got '{}', wanted none, low, medium or high", word)};
}

const char* to_string(Uncertainty level) { return kLevels[static_cast<std::size_t>(level)].first; }

double velocity_noise(Uncertainty level) { return 0.003 * scale_of(level); }

namespace {

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
      const double half_x = execution.surface.size[0] / 2, half_y = execution.surface.size[1] / 2;
      object = truth;
      for (double& extent : object.size) extent = noisy(extent, kSizeSigma, extent / 2);
      object.radius = noisy(object.radius, kSizeSigma, object.radius / 2);
      object.height = noisy(object.height, kSizeSigma, object.height / 2);
      object.mass = noisy(object.mass, kMassSigma, object.mass / 2);
      object.friction = noisy(object.friction, kFrictionSigma, object.friction / 2);
      object.x = std::clamp(noisy(object.x, kPositionSigma, -half_x), -half_x, half_x);
      object.y = std::clamp(noisy(object.y, kPositionSigma, -half_y), -half_y, half_y);
      object.yaw = random.normal(object.yaw, shrink * scale * kYawSigma);
      shrink *= 0.98;
    } while (shrink > 1e-3 && !is_free(belief, object, 0.0));
    if (!is_free(belief, object, 0.0)) return std::nullopt;
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

}  // namespace jostle::physics_pool
