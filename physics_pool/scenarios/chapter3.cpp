#include "physics_pool/scenarios/chapter3.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::physics_pool {
namespace {

constexpr std::uint32_t kSceneStream = 0x5ce4e;
constexpr int kPlacementTries = 20000;

constexpr double kTable = 0.6, kLargestTable = 2.0;  // m, side
constexpr int kThesisObjects = 15;                   // on the smaller one
constexpr double kStart = -0.33;                     // m, of the hand before the smaller one

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
  scene.surface = Surface::table(side, side);
  scene.robot = planar_gripper({.x = kStart - (side - kTable) / 2});
  scene.task = {.kind = "grasp", .target = "target"};

  SceneObject target{.name = "target", .shape = Shape::kBox};
  draw_body(random, target);
  target.x = random.normal(0.0, 0.01);
  target.y = random.normal(0.0, 0.01);
  target.yaw = random.uniform(-std::numbers::pi, std::numbers::pi);

  scene.objects.push_back(target);
  const double reach_x = side / 2 - options.edge_distance;
  const double reach_y = side / 2 - options.edge_distance;
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

}  // namespace jostle::physics_pool
