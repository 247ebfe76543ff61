// Shelves for an arm.

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <vector>

#include "physics_pool/robot/inverse_kinematics.hpp"
#include "physics_pool/robot/kinematics.hpp"
#include "physics_pool/sampling/counter_rng.hpp"
#include "physics_pool/scenarios/chapter4.hpp"
#include "physics_pool/scenarios/household.hpp"

namespace jostle::physics_pool {
namespace {

constexpr std::uint32_t kArmStream = 0x9c45;
constexpr int kPlacementTries = 20000, kSceneTries = 50;
constexpr int kBlockers = 2;

constexpr double kDepth = 0.5, kWidth = 0.8, kHeight = 0.4;  // m, of the shelf, inside
constexpr double kBoard = 0.02;                              // m, thickness
constexpr double kBelow = 0.002;                             // m, the lower board under what things stand on
constexpr double kBase = -0.85;                              // m, x of the arm: 0.6 m before the shelf
constexpr double kHandX = -0.4, kHandHeight = 0.075;         // m, at the start
constexpr double kEdge = 0.02, kGap = 0.003;                 // m, from the open side; between objects
constexpr double kClear = 0.01;                              // m, of the arm from boards
constexpr double kBeside = 0.02;                             // m, of a blocker from the straight line
// A UR5's joints, rad, with the hand before the shelf, level, elbow up; the rest is for joints_at.
constexpr std::array kElbowUp{0.36, -1.78, -2.39, -2.12, -1.21, 0.0, 0.0425, 0.0425};

Fixture board(const char* name, double z) {
  return {.name = name, .size = {kDepth, kWidth + 2 * kBoard, kBoard}, .pose = {.position = {0, 0, z}}};
}

Eigen::Isometry3d level_hand(double x, double y, double z, double yaw) {
  return Eigen::Translation3d(x, y, z) * Eigen::Isometry3d(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
}

Result<SceneRobot> arm_before_shelf() {
  auto model_result = builtin_robot("ur5_2f85");
  if (!model_result) return model_result.error();
  SceneRobot robot{.model = std::move(model_result).value(), .base = {.position = {kBase, 0, 0}}};
  const auto q = joints_at(robot.model, transform(robot.base), level_hand(kHandX, 0, kHandHeight, 0), kElbowUp);
  if (!q) return Error{Code::kInternal, "generate: no joints of the UR5 bring its hand before the shelf"};
  robot.q = *q;
  return robot;
}

// How far a point is from a fixture's body, m; negative or 0 inside.
double distance(const Fixture& fixture, const Eigen::Vector3d& point) {
  const Eigen::Vector3d p = transform(fixture.pose).inverse() * point;
  const Eigen::Vector3d half = fixture.shape == Shape::kBox
                                   ? Eigen::Vector3d(fixture.size[0], fixture.size[1], fixture.size[2]) / 2
                                   : Eigen::Vector3d(fixture.radius, fixture.radius, fixture.height / 2);
  return (p.cwiseAbs() - half).cwiseMax(0.0).norm();
}

// Points on the surface of a geom: corners of a box; of what is round, three rings, of 8 points each.
std::vector<Eigen::Vector3d> points_of(const RobotGeom& geom) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 24; ++i) {
    const int ring = i / 8 - 1;  // -1, 0, 1
    const double turn = std::numbers::pi / 4 * (i % 8), along = ring;
    if (geom.shape == GeomShape::kBox) {
      const double x = i & 1 ? 0.5 : -0.5, y = i & 2 ? 0.5 : -0.5, z = i & 4 ? 0.5 : -0.5;
      points.emplace_back(x * geom.size[0], y * geom.size[1], z * geom.size[2]);
    } else {
      points.emplace_back(geom.radius * std::cos(turn), geom.radius * std::sin(turn), along * geom.height / 2);
    }
  }
  return points;
}

bool is_clear(const Scene& scene, const Eigen::Isometry3d& X, const RobotGeom& geom) {
  return std::ranges::all_of(points_of(geom), [&](const Eigen::Vector3d& point) {
    return std::ranges::all_of(scene.fixtures, [&](const Fixture& f) { return distance(f, X * point) > kClear; });
  });
}

bool is_clear(const Scene& scene, std::span<const double> q) {
  const RobotModel& robot = scene.robot.model;
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const Eigen::Isometry3d X = link_pose(robot, transform(scene.robot.base), q, static_cast<int>(i));
    for (const RobotGeom& geom : robot.links[i].geoms) {
      if (!is_clear(scene, X * transform(geom.pose), geom)) return false;
    }
  }
  return true;
}

double friction(CounterStream& random) { return random.uniform(0.2, 0.4); }

Household other_than_bowls(CounterStream& random) {
  Household thing;
  do {
    thing = static_cast<Household>(std::min(static_cast<int>(random.uniform(0, kHouseholds)), kHouseholds - 1));
  } while (thing == Household::kBowl);
  return thing;
}

// One is a mug and one a bowl, so that every scene has both; the others are anything.
Household thing_of(int i, CounterStream& random) {
  if (i < kBlockers) return other_than_bowls(random);
  if (i == kBlockers) return Household::kBowl;
  if (i == kBlockers + 1) return Household::kMug;
  return other_than_bowls(random);
}

// Puts an object somewhere free; whether there was a place.
template <class Draw>
bool place(Scene& scene, SceneObject object, CounterStream& random, Draw draw) {
  for (int tries = 0; tries < kPlacementTries; ++tries) {
    draw(object);
    object.yaw = random.uniform(-std::numbers::pi, std::numbers::pi);
    const double reach = object.reach();
    if (object.x < -kDepth / 2 + kEdge + reach || !is_free(scene, object, kGap)) continue;
    scene.objects.push_back(std::move(object));
    return true;
  }
  return false;
}

bool fill(Scene& scene, int objects, CounterStream& random) {
  scene.objects.clear();
  SceneObject target = household_object(Household::kSoupCan, "target", friction(random));
  target.x = random.uniform(0.03, 0.13);
  target.y = random.uniform(-0.16, 0.16);
  scene.objects.push_back(target);
  if (!is_reachable(scene)) return false;
  const double way = std::hypot(target.x - kHandX, target.y);
  const double along_x = (target.x - kHandX) / way, along_y = target.y / way;
  for (int i = 0; i < objects; ++i) {
    const Household thing = thing_of(i, random);
    SceneObject object = household_object(thing, fmt::format("{}_{}", to_string(thing), i + 1), friction(random));
    const bool is_placed = place(scene, object, random, [&](SceneObject& moved) {
      if (i < kBlockers) {
        const double before = random.uniform(0.07, 0.3), beside = random.uniform(-kBeside, kBeside);
        moved.x = target.x - before * along_x - beside * along_y;
        moved.y = target.y - before * along_y + beside * along_x;
      } else {
        moved.x = random.uniform(-kDepth / 2, kDepth / 2);
        moved.y = random.uniform(-kWidth / 2, kWidth / 2);
      }
    });
    if (!is_placed) return false;
  }
  return true;
}

}  // namespace

bool is_reachable(const Scene& scene) {
  constexpr int kSteps = 20;
  const SceneRobot& robot = scene.robot;
  const Eigen::Isometry3d base = transform(robot.base), from = tool_pose(robot.model, base, robot.q);
  const SceneObject& target = scene.objects[static_cast<std::size_t>(scene.target())];
  const Eigen::Vector3d way(target.x - from.translation().x(), target.y - from.translation().y(), 0);
  const double share = 1 - robot.model.hand->depth / way.norm();
  std::vector<double> q = robot.q;
  for (int i = 0; i <= kSteps; ++i) {
    Eigen::Isometry3d X = from;
    X.translation() += share * i / kSteps * way;
    const auto next = joints_at(robot.model, base, X, q);
    if (!next || !is_clear(scene, *next)) return false;
    q = *next;
  }
  return true;
}

Result<Scene> generate_chapter4_arm(const GenerateShelfOptions& options) {
  if (options.objects < kBlockers || options.objects > 15) {
    return Error{Code::kInvalidArgument, fmt::format("objects: got {}, wanted {} to 15", options.objects, kBlockers)};
  }
  CounterStream random(options.seed, kArmStream);
  Scene scene;
  scene.name = fmt::format("chapter4-arm-{}-{}", options.objects, options.seed);
  scene.surface = Surface::table(kDepth, kWidth);
  scene.fixtures = shelf_walls(scene.surface.bounds(), kHeight);
  scene.fixtures.push_back(board("board_below", -kBelow - kBoard / 2));
  scene.fixtures.push_back(board("board_above", kHeight + kBoard / 2));
  auto robot_result = arm_before_shelf();
  if (!robot_result) return robot_result.error();
  scene.robot = std::move(robot_result).value();
  scene.task = {.kind = "grasp", .target = "target"};
  for (int tries = 0; tries < kSceneTries; ++tries) {
    if (fill(scene, options.objects, random)) return scene;
  }
  return Error{Code::kInvalidArgument,
               fmt::format("objects: no free places for {} in {} shelves; wanted fewer objects or another seed than {}",
                           options.objects, kSceneTries, options.seed)};
}

}  // namespace jostle::physics_pool
