#include "physics_pool/scene/scene.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "physics_pool/scene/outline.hpp"
#include "physics_pool/scene/planar_gripper.hpp"

namespace jostle::physics_pool {
namespace {

// An outline somewhere in the surface's plane.
struct Footprint {
  double x = 0.0, y = 0.0, yaw = 0.0;
  Outline outline;
};

Footprint footprint(const SceneObject& object) {
  return {.x = object.x, .y = object.y, .yaw = object.yaw, .outline = outline(object)};
}

Footprint footprint(const Disc& disc) { return {.x = disc.x, .y = disc.y, .outline = {.radius = disc.radius}}; }

std::vector<Footprint> footprint(const SceneRobot& robot) {
  namespace hand = planar_gripper;
  if (robot.is_pusher()) return {footprint(Disc{robot.x, robot.y, robot.radius})};
  const double c = std::cos(robot.rotation), s = std::sin(robot.rotation);
  const auto part = [&](double x_min, double x_max, double y, double width) {
    const double x = (x_min + x_max) / 2;
    return Footprint{.x = robot.x + c * x - s * y,
                     .y = robot.y + s * x + c * y,
                     .yaw = robot.rotation,
                     .outline = {.half_x = (x_max - x_min) / 2, .half_y = width / 2}};
  };
  const double finger_y = (robot.opening + hand::kFingerThickness) / 2;
  return {part(0, hand::kFingerLength, finger_y, hand::kFingerThickness),
          part(0, hand::kFingerLength, -finger_y, hand::kFingerThickness),
          part(-hand::kPalmDepth, 0, 0, hand::kPalmWidth),
          part(-hand::kPalmDepth - hand::kArmLength, -hand::kPalmDepth, 0, hand::kArmWidth)};
}

double disc_gap(const Footprint& disc, const Footprint& other) {
  const double dx = disc.x - other.x, dy = disc.y - other.y;
  const double c = std::cos(other.yaw), s = std::sin(other.yaw);
  return nearest(other.outline, c * dx + s * dy, -s * dx + c * dy).distance - disc.outline.radius;
}

// The largest separation along any of the four edge normals: exact where
// rectangles overlap, a lower bound of their distance where they do not.
double rectangle_gap(const Footprint& a, const Footprint& b) {
  double gap = -std::numeric_limits<double>::infinity();
  const double dx = b.x - a.x, dy = b.y - a.y;
  for (const double yaw : {a.yaw, a.yaw + std::numbers::pi / 2, b.yaw, b.yaw + std::numbers::pi / 2}) {
    const auto reach = [&](const Footprint& f) {
      return f.outline.half_x * std::abs(std::cos(f.yaw - yaw)) + f.outline.half_y * std::abs(std::sin(f.yaw - yaw));
    };
    const double centres = std::abs(dx * std::cos(yaw) + dy * std::sin(yaw));
    gap = std::max(gap, centres - reach(a) - reach(b));
  }
  return gap;
}

double footprint_gap(const Footprint& a, const Footprint& b) {
  if (a.outline.radius > 0) return disc_gap(a, b);
  if (b.outline.radius > 0) return disc_gap(b, a);
  return rectangle_gap(a, b);
}

// A field of a scene, as a file spells it and as people like to read it.
struct Field {
  std::string path;   // "objects[3].pose.x"
  std::string shown;  // "objects[3] ('can').pose.x"
};

Error invalid(const Locate& locate, const Field& field, const std::string& problem) {
  return {Code::kInvalidArgument, fmt::format("{}: {}: {}", locate(field.path), field.shown, problem)};
}

bool in_range(double value, double low, double high) { return value >= low && value <= high; }

// A field, its value and the closed range it must lie in.
struct Range {
  const char* field;
  double value, low, high;
  const char* unit;
};

Result<void> check(const Locate& locate, const Field& parent, std::initializer_list<Range> ranges) {
  for (const Range& r : ranges) {
    if (in_range(r.value, r.low, r.high)) continue;  // false for NaN
    return invalid(locate, {parent.path + r.field, parent.shown + r.field},
                   fmt::format("got {}, wanted {} to {} {}", r.value, r.low, r.high, r.unit));
  }
  return {};
}

constexpr double kSmallest = 0.002, kLargest = 2.0;  // m, any size of an object

// One of a field's words, or the complaint.
Result<void> check_word(const Locate& locate, const char* field, const std::string& got,
                        std::initializer_list<const char*> words) {
  if (std::ranges::find(words, got) != words.end()) return {};
  return invalid(locate, {field, field}, fmt::format("got '{}', wanted one of: {}", got, fmt::join(words, ", ")));
}

// What only pushing has.
Result<void> check_push(const Scene& scene, const Locate& locate) {
  const double half_x = scene.surface.size[0] / 2, half_y = scene.surface.size[1] / 2;
  const auto check_disc = [&](const std::string& field, const Disc& disc) {
    return check(locate, {field, field},
                 {{".x", disc.x, -half_x, half_x, "m, on the surface"},
                  {".y", disc.y, -half_y, half_y, "m, on the surface"},
                  {".radius", disc.radius, kSmallest, kLargest, "m"}});
  };
  if (auto ok = check_disc("task.goal", scene.task.goal); !ok) return ok;
  if (!scene.task.obstacle) return {};
  return check_disc("task.obstacle", *scene.task.obstacle);
}

}  // namespace

double SceneObject::rest_height() const { return (shape == Shape::kBox ? size[2] : height) / 2; }

int Scene::target() const {
  const auto found = std::ranges::find(objects, task.target, &SceneObject::name);
  return found == objects.end() ? -1 : static_cast<int>(found - objects.begin());
}

double signed_distance(const SceneObject& object, const Disc& disc) {
  return disc_gap(footprint(disc), footprint(object));
}

bool overlap(const SceneObject& a, const SceneObject& b, double gap) {
  return footprint_gap(footprint(a), footprint(b)) < gap;
}

bool overlaps_robot(const Scene& scene, const SceneObject& object, double gap) {
  const Footprint body = footprint(object);
  return std::ranges::any_of(footprint(scene.robot),
                             [&](const Footprint& part) { return footprint_gap(part, body) < gap; });
}

bool is_free(const Scene& scene, const SceneObject& object, double gap) {
  return !overlaps_robot(scene, object, gap) &&
         std::ranges::none_of(scene.objects, [&](const SceneObject& other) { return overlap(object, other, gap); });
}

Result<void> validate(const Scene& scene, const std::string& origin) {
  return validate(scene, [&](std::string_view) { return origin; });
}

Result<void> validate(const Scene& scene, const Locate& locate) {
  const SceneRobot& robot = scene.robot;
  if (auto ok = check_word(locate, "robot.model", robot.model, {"planar_gripper", "pusher"}); !ok) return ok;
  if (auto ok = check_word(locate, "task.kind", scene.task.kind, {"grasp", "push"}); !ok) return ok;
  if (robot.is_pusher() != scene.task.is_push()) {
    return invalid(locate, {"task.kind", "task.kind"},
                   fmt::format("got '{}' for a {}, wanted grasp with a planar_gripper or push with a pusher",
                               scene.task.kind, robot.model));
  }
  if (auto ok = check_word(locate, "physics.integrator", scene.physics.integrator, {"euler", "rk4"}); !ok) return ok;
  const double half_x = scene.surface.size[0] / 2, half_y = scene.surface.size[1] / 2;
  if (auto ok = check(locate, {},
                      {{"surface.size[0]", scene.surface.size[0], 0.1, 10, "m"},
                       {"surface.size[1]", scene.surface.size[1], 0.1, 10, "m"},
                       {"surface.wall_height", scene.surface.wall_height, 0.01, 2, "m"},
                       {"robot.start.x", robot.x, -10, 10, "m"},
                       {"robot.start.y", robot.y, -10, 10, "m"},
                       {"robot.start.rotation", robot.rotation, -7, 7, "rad"},
                       {"robot.start.opening", robot.opening, 0, planar_gripper::kStroke, "m"},
                       {"robot.radius", robot.radius, kSmallest, kLargest, "m"},
                       {"robot.height", robot.height, kSmallest, kLargest, "m"},
                       {"physics.time_step", scene.physics.time_step, 1e-4, 0.02, "s"},
                       {"physics.iterations", double(scene.physics.iterations), 1, 1000, ""},
                       {"physics.tolerance", scene.physics.tolerance, 0, 1, ""}});
      !ok) {
    return ok;
  }
  std::set<std::string> names;
  for (std::size_t i = 0; i < scene.objects.size(); ++i) {
    const SceneObject& object = scene.objects[i];
    const Field parent{fmt::format("objects[{}].", i), fmt::format("objects[{}] ('{}').", i, object.name)};
    const auto invalid_at = [&](const char* field, const std::string& problem) {
      return invalid(locate, {parent.path + field, parent.shown + field}, problem);
    };
    if (object.name.empty()) return invalid_at("name", "got '', wanted a name");
    if (!names.insert(object.name).second) {
      return invalid_at("name", "already taken by another object, wanted a unique name");
    }
    auto sizes = object.shape == Shape::kBox ? check(locate, parent,
                                                     {{"size[0]", object.size[0], kSmallest, kLargest, "m"},
                                                      {"size[1]", object.size[1], kSmallest, kLargest, "m"},
                                                      {"size[2]", object.size[2], kSmallest, kLargest, "m"}})
                                             : check(locate, parent,
                                                     {{"radius", object.radius, kSmallest, kLargest, "m"},
                                                      {"height", object.height, kSmallest, kLargest, "m"}});
    if (!sizes) return sizes;
    if (auto ok = check(locate, parent,
                        {{"mass", object.mass, 1e-4, 100, "kg"},
                         {"friction", object.friction, 0, 5, ""},
                         {"pose.x", object.x, -half_x, half_x, "m, on the surface"},
                         {"pose.y", object.y, -half_y, half_y, "m, on the surface"},
                         {"pose.yaw", object.yaw, -7, 7, "rad"}});
        !ok) {
      return ok;
    }
    for (std::size_t j = 0; j < i; ++j) {
      if (!overlap(object, scene.objects[j])) continue;
      return invalid_at("pose",
                        fmt::format("inside object '{}' by {:.1f} mm, wanted a free place", scene.objects[j].name,
                                    -1e3 * footprint_gap(footprint(object), footprint(scene.objects[j]))));
    }
    if (overlaps_robot(scene, object)) {
      return invalid_at("pose", "inside the robot at its start, wanted a free place; move robot.start or the object");
    }
  }
  if (scene.target() < 0) {
    return invalid(locate, {"task.target", "task.target"},
                   fmt::format("got '{}', wanted the name of an object", scene.task.target));
  }
  return scene.task.is_push() ? check_push(scene, locate) : Result<void>{};
}

StateLayout layout_of(const Scene& scene) {
  StateLayout layout;
  if (scene.robot.is_pusher()) {
    layout.joints = {"pusher_x", "pusher_y"};
    layout.nu = kPusherAxes;
  } else {
    layout.joints = {"gripper_x", "gripper_y", "gripper_rotation", "finger_left", "finger_right"};
    layout.nu = kGripperAxes;
  }
  layout.nq = layout.nv = layout.robot_joints();
  for (const SceneObject& object : scene.objects) {
    layout.objects.push_back({.name = object.name, .q = layout.nq, .v = layout.nv});
    layout.nq += 7;
    layout.nv += 6;
  }
  layout.target = scene.target();
  return layout;
}

State initial_state(const Scene& scene) {
  const SceneRobot& robot = scene.robot;
  State state;
  state.q = {robot.x, robot.y};
  if (!robot.is_pusher()) state.q.insert(state.q.end(), {robot.rotation, robot.opening / 2, robot.opening / 2});
  for (const SceneObject& object : scene.objects) {
    state.q.insert(state.q.end(), {object.x, object.y, object.rest_height(), std::cos(object.yaw / 2), 0, 0,
                                   std::sin(object.yaw / 2)});
  }
  state.v.assign(static_cast<std::size_t>(layout_of(scene).nv), 0.0);
  return state;
}

}  // namespace jostle::physics_pool
