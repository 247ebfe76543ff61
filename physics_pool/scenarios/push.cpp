#include "physics_pool/scenarios/push.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::physics_pool {
namespace {

constexpr std::uint32_t kPushStream = 0x9054;
constexpr int kLayoutTries = 1000, kPlaceTries = 100;

// scenes/README.md says why.
constexpr double kTableX = 1.0, kTableY = 0.8;                 // m
constexpr double kTargetX = -0.25, kGoalX = 0.25;              // m, middles
constexpr double kSpreadX = 0.03, kSpreadY = 0.1;              // m, either side of them
constexpr double kGoalRadius = 0.04, kObstacleRadius = 0.04;   // m
constexpr double kObstacleOff = 0.02;                          // m off the straight way, at most
constexpr double kBoxTurn = 0.3;                               // rad off the way, at most
constexpr double kNearestStart = 0.01, kFarthestStart = 0.02;  // m, pusher to target
constexpr double kGap = 0.005;                                 // m between sliders, and to the pusher
constexpr double kFirst = 0.15, kLast = 0.8;                   // of the way, where other sliders may be
constexpr double kBeside = 0.16;                               // m beside it, at most

// The way from the target's start to the goal region's centre.
struct Way {
  double x, y, dx, dy, length;  // start, unit direction, m

  double x_at(double along, double left) const { return x + along * dx - left * dy; }
  double y_at(double along, double left) const { return y + along * dy + left * dx; }
};

// Measures of the author's public code (parareal-manip).
SceneObject make_slider(std::string name, Shape shape) {
  SceneObject slider{.name = std::move(name), .shape = shape, .mass = 0.5};
  if (shape == Shape::kBox) {
    slider.size = {0.109, 0.154, 0.011};
    slider.friction = 0.8;
  } else {
    slider.radius = 0.05115;
    slider.height = 0.0245;
    slider.friction = 0.2;
  }
  return slider;
}

double largest_radius(const SceneObject& object) {
  return object.shape == Shape::kBox ? std::hypot(object.size[0], object.size[1]) / 2 : object.radius;
}

// Puts the pusher behind the target, `gap` metres from it: as far back as is surely
// free, then forward by what is known to be free.
void place_pusher(Scene& scene, const SceneObject& target, const Way& way, double gap) {
  constexpr double kClose = 1e-9;  // m
  const double radius = *disc_radius(scene.robot.model);
  double back = largest_radius(target) + radius + gap;
  for (;;) {
    scene.robot.q = {way.x_at(-back, 0.0), way.y_at(-back, 0.0)};
    const double free = signed_distance(target, {.x = scene.robot.q[0], .y = scene.robot.q[1], .radius = radius}) - gap;
    if (free <= kClose) return;
    back -= free;
  }
}

// Table, target, goal region and pusher; leaves the way in `way`.
Scene begin(const GeneratePushOptions& options, CounterStream& random, Way& way) {
  Scene scene;
  scene.surface = Surface::table(kTableX, kTableY);
  scene.robot = pusher();
  scene.task = {.kind = "push", .target = "target"};
  scene.physics = {.time_step = 0.001, .integrator = options.integrator};
  SceneObject target = make_slider("target", options.shape);
  target.x = kTargetX + random.uniform(-kSpreadX, kSpreadX);
  target.y = random.uniform(-kSpreadY, kSpreadY);
  scene.task.goal = {.x = kGoalX + random.uniform(-kSpreadX, kSpreadX),
                     .y = random.uniform(-kSpreadY, kSpreadY),
                     .radius = kGoalRadius};
  const double dx = scene.task.goal.x - target.x, dy = scene.task.goal.y - target.y;
  const double length = std::hypot(dx, dy);
  way = {.x = target.x, .y = target.y, .dx = dx / length, .dy = dy / length, .length = length};
  const double turn = random.uniform(-kBoxTurn, kBoxTurn);  // drawn for every shape: equal layouts
  if (options.shape == Shape::kBox) target.yaw = std::atan2(dy, dx) + turn;
  place_pusher(scene, target, way, random.uniform(kNearestStart, kFarthestStart));
  scene.objects.push_back(std::move(target));
  return scene;
}

// A free place for one more slider near the way, if luck has it.
bool add_slider(Scene& scene, const Way& way, Shape shape, CounterStream& random) {
  SceneObject slider = make_slider(fmt::format("slider{}", scene.objects.size()), shape);
  // The target, wherever in the goal region, touches nothing.
  const Disc kept_free{.x = scene.task.goal.x,
                       .y = scene.task.goal.y,
                       .radius = kGoalRadius + largest_radius(scene.objects.front()) + kGap};
  for (int i = 0; i < kPlaceTries; ++i) {
    const double along = random.uniform(kFirst, kLast) * way.length, left = random.uniform(-kBeside, kBeside);
    slider.x = way.x_at(along, left);
    slider.y = way.y_at(along, left);
    slider.yaw = shape == Shape::kBox ? random.uniform(-1.5, 1.5) : 0.0;
    if (signed_distance(slider, kept_free) < 0 || !is_free(scene, slider, kGap)) continue;
    scene.objects.push_back(slider);
    return true;
  }
  return false;
}

Result<Scene> checked(Scene scene) {
  if (auto ok = validate(scene, scene.name); !ok) return ok.error();
  return scene;
}

}  // namespace

Result<Scene> generate_chapter6(const GeneratePushOptions& options) {
  CounterStream random(options.seed, kPushStream);
  Way way{};
  Scene scene = begin(options, random, way);
  scene.name = fmt::format("chapter6-{}", options.seed);
  const double off = random.uniform(-kObstacleOff, kObstacleOff);
  scene.task.obstacle =
      Disc{.x = way.x_at(way.length / 2, off), .y = way.y_at(way.length / 2, off), .radius = kObstacleRadius};
  return checked(std::move(scene));
}

Result<Scene> generate_chapter7(const GeneratePushOptions& options) {
  constexpr int kMostObjects = 3;
  if (options.objects < 0 || options.objects > kMostObjects) {
    return Error{Code::kInvalidArgument, fmt::format("objects: got {}, wanted 0 to {}", options.objects, kMostObjects)};
  }
  CounterStream random(options.seed, kPushStream);
  for (int i = 0; i < kLayoutTries; ++i) {
    Way way{};
    Scene scene = begin(options, random, way);
    scene.name = fmt::format("chapter7-{}-{}", options.objects, options.seed);
    int added = 0;
    while (added < options.objects && add_slider(scene, way, options.shape, random)) ++added;
    if (added == options.objects) return checked(std::move(scene));
  }
  return Error{Code::kInternal, fmt::format("objects: no layout of {} sliders found, wanted another seed than {}",
                                            options.objects, options.seed)};
}

}  // namespace jostle::physics_pool
