#include "physics_pool/scenarios/chapter5.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "physics_pool/sampling/counter_rng.hpp"

namespace jostle::physics_pool {
namespace {

constexpr std::uint32_t kAdaptiveStream = 0xada97;
constexpr int kPlacementTries = 20000;

// scenes/README.md says why.
constexpr double kLength = 0.6, kFromEnd = 0.1;                // m (footnote 2)
constexpr double kSpread = 0.01;                               // m (footnote 2)
constexpr double kWideLength = 1.0;                            // m, and width
constexpr double kStrip = 0.2;                                 // m, width
constexpr double kSmallGoal = 0.03, kLargeGoal = 0.15;         // m, radius
constexpr double kNearestStart = 0.01, kFarthestStart = 0.02;  // m, hand to object
constexpr double kFingerLength = 0.07;                         // m, of the model
constexpr double kOpening = 0.085;                             // m
constexpr double kGap = 0.003;                                 // m between objects
constexpr double kEdgeDistance = 0.08;                         // m, of centres in clutter
constexpr double kHandRoom = 0.18;                             // m before the lower end, where clutter has none

constexpr std::array<std::pair<const char*, AdaptiveTask>, 5> kTasks{{{"wide", AdaptiveTask::kWide},
                                                                      {"strip", AdaptiveTask::kStrip},
                                                                      {"changing", AdaptiveTask::kChanging},
                                                                      {"l", AdaptiveTask::kL},
                                                                      {"clutter", AdaptiveTask::kClutter}}};

// Footnote 1.
SceneObject draw_object(CounterStream& random, std::string name, bool may_be_cylinder = true) {
  SceneObject object{.name = std::move(name)};
  object.shape = random.coin() || !may_be_cylinder ? Shape::kBox : Shape::kCylinder;
  if (object.shape == Shape::kBox) {
    object.size = {random.uniform(0.05, 0.075), random.uniform(0.05, 0.075), random.uniform(0.036, 0.05)};
  } else {
    object.radius = random.uniform(0.04, 0.07);
    object.height = random.uniform(0.04, 0.05);
  }
  object.mass = random.uniform(0.2, 0.8);
  object.friction = random.uniform(0.2, 0.6);
  return object;
}

// The surface and the goal region of a task to push.
void set_table(AdaptiveTask task, Scene& scene) {
  const double low = -kLength / 2, goal_x = kLength / 2 - kFromEnd;
  Disc& goal = scene.task.goal;
  switch (task) {
    case AdaptiveTask::kStrip:
      scene.surface = Surface::table(kLength, kStrip);
      goal = {.x = goal_x, .radius = kSmallGoal};
      return;
    case AdaptiveTask::kChanging: {  // wide up to the middle
      constexpr double kStripLength = 0.4;
      scene.surface = {
          {{.x = low / 2, .size = {kLength / 2, kLength}}, {.x = kStripLength / 2, .size = {kStripLength, kStrip}}}};
      goal = {.x = kStripLength - kFromEnd, .radius = kSmallGoal};
      return;
    }
    case AdaptiveTask::kL: {  // along x, then to the left
      constexpr double kWidth = 0.25, kLeg = 0.3;
      scene.surface = {{{.size = {kLength, kWidth}},
                        {.x = (kLength - kWidth) / 2, .y = (kWidth + kLeg) / 2, .size = {kWidth, kLeg}}}};
      goal = {.x = (kLength - kWidth) / 2, .y = kWidth / 2 + kLeg - kFromEnd, .radius = 0.05};
      return;
    }
    case AdaptiveTask::kWide:  // the same way, and as much again behind the goal
      scene.surface = {{{.x = low + kWideLength / 2, .size = {kWideLength, kWideLength}}}};
      goal = {.x = goal_x, .radius = kLargeGoal};
      return;
    case AdaptiveTask::kClutter:
      scene.surface = Surface::table(kLength, kLength);
  }
}

// Puts the hand behind an object, `gap` metres from it: as far back as is surely free, then forward by what is found to
// be free.
void place_hand(Scene& scene, const SceneObject& object, double gap) {
  const double radius = object.shape == Shape::kBox ? std::hypot(object.size[0], object.size[1]) / 2 : object.radius;
  constexpr double kStep = 0.0005;  // m
  scene.robot = planar_gripper({.x = object.x - radius - kFingerLength - gap, .opening = kOpening});
  double& x = scene.robot.q[0];
  while (!overlaps_robot(scene, object, gap)) x += kStep;
  x -= kStep;
}

Result<Scene> checked(Scene scene) {
  if (auto ok = validate(scene, scene.name); !ok) return ok.error();
  return scene;
}

Result<Scene> clutter(const GenerateAdaptiveOptions& options) {
  CounterStream random(options.seed, kAdaptiveStream);
  Scene scene;
  scene.name = fmt::format("chapter5-clutter-{}-{}", options.objects, options.seed);
  set_table(AdaptiveTask::kClutter, scene);
  scene.robot = planar_gripper({.x = -kLength / 2 - kFingerLength, .opening = kOpening});
  scene.task = {.kind = "grasp", .target = "target"};
  // A cylinder of 8 to 14 cm has no room in the hand. Near the far edge, as in Fig. 5.5.
  SceneObject target = draw_object(random, "target", false);
  target.x = random.normal(kLength / 2 - kFromEnd, kSpread);
  target.y = random.normal(0.0, kSpread);
  target.yaw = random.uniform(-std::numbers::pi, std::numbers::pi);
  scene.objects.push_back(std::move(target));
  const double reach = kLength / 2 - kEdgeDistance;
  for (int i = 0; i < options.objects; ++i) {
    SceneObject object = draw_object(random, fmt::format("object{}", i + 1));
    int tries = 0;
    do {
      if (++tries > kPlacementTries) {
        return Error{Code::kInvalidArgument,
                     fmt::format("objects: no free place left for number {} of {}; wanted fewer objects or another "
                                 "seed than {}",
                                 i + 1, options.objects, options.seed)};
      }
      object.x = random.uniform(-kLength / 2 + kHandRoom, reach);
      object.y = random.uniform(-reach, reach);
      object.yaw = random.uniform(-std::numbers::pi, std::numbers::pi);
    } while (!is_free(scene, object, kGap));
    scene.objects.push_back(object);
  }
  return checked(std::move(scene));
}

}  // namespace

std::optional<AdaptiveTask> parse_adaptive_task(std::string_view word) {
  for (const auto& [name, task] : kTasks) {
    if (word == name) return task;
  }
  return {};
}

const char* to_string(AdaptiveTask task) { return kTasks[static_cast<std::size_t>(task)].first; }

Result<Scene> generate_chapter5(const GenerateAdaptiveOptions& options) {
  constexpr int kMostObjects = 20;
  if (options.objects < 0 || options.objects > kMostObjects) {
    return Error{Code::kInvalidArgument, fmt::format("objects: got {}, wanted 0 to {}", options.objects, kMostObjects)};
  }
  if (options.task == AdaptiveTask::kClutter) return clutter(options);
  CounterStream random(options.seed, kAdaptiveStream);
  Scene scene;
  scene.name = fmt::format("chapter5-{}-{}", to_string(options.task), options.seed);
  scene.task = {.kind = "push", .target = "target"};
  set_table(options.task, scene);
  SceneObject target = draw_object(random, "target");
  target.x = random.normal(-kLength / 2 + kFromEnd, kSpread);
  target.y = random.normal(0.0, kSpread);
  target.yaw = random.uniform(-std::numbers::pi, std::numbers::pi);
  place_hand(scene, target, random.uniform(kNearestStart, kFarthestStart));
  scene.objects.push_back(std::move(target));
  return checked(std::move(scene));
}

}  // namespace jostle::physics_pool
