#include "physics_pool/scenarios/chapter4.hpp"

#include <fmt/format.h>

#include <cmath>
#include <numbers>

#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::physics_pool {
namespace {

constexpr std::uint32_t kShelfStream = 0x9c44;
constexpr int kPlacementTries = 20000;
constexpr int kBlockers = 2;

constexpr double kDepth = 0.6, kWidth = 0.5, kWall = 0.15;  // m
constexpr double kStart = -0.33;                            // m, of the hand before the shelf
constexpr double kEdge = 0.05, kGap = 0.003;                // m, from the open side; between objects
constexpr double kBeside = 0.02;                            // m, of a blocker from the straight line

SceneObject draw_object(CounterStream& random, std::string name, Shape shape) {
  SceneObject object{.name = std::move(name), .shape = shape};
  if (shape == Shape::kBox) {
    object.size = {random.uniform(0.03, 0.05), random.uniform(0.03, 0.05), random.uniform(0.036, 0.04)};
  } else {
    object.radius = random.uniform(0.035, 0.04);
    object.height = random.uniform(0.04, 0.055);
  }
  object.mass = random.uniform(0.5, 0.8);
  object.friction = random.uniform(0.2, 0.4);
  object.yaw = random.uniform(-std::numbers::pi, std::numbers::pi);
  return object;
}

}  // namespace

Result<Scene> generate_chapter4(const GenerateShelfOptions& options) {
  if (options.objects < kBlockers || options.objects > 15) {
    return Error{Code::kInvalidArgument, fmt::format("objects: got {}, wanted {} to 15", options.objects, kBlockers)};
  }
  CounterStream random(options.seed, kShelfStream);
  Scene scene;
  scene.name = fmt::format("chapter4-{}-{}", options.objects, options.seed);
  scene.surface = Surface::table(kDepth, kWidth);
  scene.fixtures = shelf_walls(scene.surface.bounds(), kWall);
  scene.robot = planar_gripper({.x = kStart});
  scene.task = {.kind = "grasp", .target = "target"};

  SceneObject target = draw_object(random, "target", Shape::kBox);
  target.x = random.uniform(0.08, 0.18);
  target.y = random.uniform(-0.12, 0.12);
  scene.objects.push_back(target);
  const double way = std::hypot(target.x - kStart, target.y);
  const double along_x = (target.x - kStart) / way, along_y = target.y / way;

  for (int i = 0; i < options.objects; ++i) {
    SceneObject object =
        draw_object(random, fmt::format("object{}", i + 1), random.coin() ? Shape::kBox : Shape::kCylinder);
    int tries = 0;
    do {
      if (++tries > kPlacementTries) {
        return Error{
            Code::kInvalidArgument,
            fmt::format("objects: no free place left for number {} of {}; wanted fewer objects or another seed "
                        "than {}",
                        i + 1, options.objects, options.seed)};
      }
      if (i < kBlockers) {
        const double before = random.uniform(0.07, 0.26), beside = random.uniform(-kBeside, kBeside);
        object.x = target.x - before * along_x - beside * along_y;
        object.y = target.y - before * along_y + beside * along_x;
      } else {
        object.x = random.uniform(-kDepth / 2 + kEdge, kDepth / 2);
        object.y = random.uniform(-kWidth / 2, kWidth / 2);
      }
    } while (!is_free(scene, object, kGap));
    scene.objects.push_back(object);
  }
  return scene;
}

}  // namespace jostle::physics_pool
