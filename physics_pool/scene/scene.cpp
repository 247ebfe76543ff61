#include "physics_pool/scene/scene.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <numbers>
#include <optional>
#include <set>

#include "idl/text/nearest.hpp"
#include "physics_pool/robot/kinematics.hpp"
#include "physics_pool/scene/outline.hpp"
#include "physics_pool/scene/scene_problems.hpp"
#include "physics_pool/scene/task_kind.hpp"

namespace jostle::physics_pool {
namespace {

constexpr double kSmallest = 0.002, kLargest = 2.0;  // m, any size of an object

// An outline somewhere in the surface's plane.
struct Footprint {
  double x = 0.0, y = 0.0, yaw = 0.0;
  Outline outline;
};

Footprint footprint(const Disc& disc) { return {.x = disc.x, .y = disc.y, .outline = {.radius = disc.radius}}; }

// What of a geom that stands upright one sees from above; nothing of others.
std::optional<Footprint> footprint(const Eigen::Isometry3d& X_WG, const RobotGeom& geom) {
  constexpr double kUpright = 1 - 1e-6;
  const Eigen::Matrix3d& R = X_WG.linear();
  if (R(2, 2) < kUpright) return {};
  Footprint seen{.x = X_WG.translation().x(), .y = X_WG.translation().y(), .yaw = std::atan2(R(1, 0), R(0, 0))};
  if (geom.shape == GeomShape::kBox) {
    seen.outline = {.half_x = geom.size[0] / 2, .half_y = geom.size[1] / 2};
  } else if (geom.shape == GeomShape::kCylinder) {
    seen.outline = {.radius = geom.radius};
  } else {
    return {};
  }
  return seen;
}

// Half the extents, along the axes of the frame that X leads to, of the box around a body. Of a body that is an
// object's part or a fixture.
template <class Body>
Eigen::Vector3d half_extents(const Eigen::Isometry3d& X, const Body& body) {
  const Eigen::Vector3d half = body.shape == Shape::kBox ? Eigen::Vector3d(body.size[0], body.size[1], body.size[2]) / 2
                                                         : Eigen::Vector3d(body.radius, body.radius, body.height / 2);
  return X.linear().cwiseAbs() * half;
}

// What one sees of a body from above; of one that leans, what is around it.
template <class Body>
Footprint seen_from_above(const Eigen::Isometry3d& X, const Body& body) {
  const RobotGeom geom{.shape = body.shape == Shape::kBox ? GeomShape::kBox : GeomShape::kCylinder,
                       .size = body.size,
                       .radius = body.radius};
  if (const auto seen = footprint(X, geom)) return *seen;
  const Eigen::Vector3d reach = half_extents(X, body), centre = X.translation();
  return {.x = centre.x(), .y = centre.y(), .outline = {.half_x = reach.x(), .half_y = reach.y()}};
}

// What of a fixture is no higher than `height` above the surface, from above.
std::optional<Footprint> footprint(const Fixture& fixture, double height) {
  const Eigen::Isometry3d X = transform(fixture.pose);
  const double reach = half_extents(X, fixture).z(), centre = X.translation().z();
  if (centre - reach >= height || centre + reach <= 0) return {};
  return seen_from_above(X, fixture);
}

// Those of the shape that it stands on, and of its parts.
std::vector<Footprint> footprints(const SceneObject& object) {
  std::vector<Footprint> seen{{.x = object.x, .y = object.y, .yaw = object.yaw, .outline = outline(object)}};
  if (object.parts.empty()) return seen;
  const Eigen::Isometry3d X_WB =
      transform({.position = {object.x, object.y, object.rest_height()}, .orientation = turned_about_z(object.yaw)});
  for (const ObjectPart& part : object.parts) seen.push_back(seen_from_above(X_WB * transform(part.pose), part));
  return seen;
}

// The footprint of a robot that moves in the plane; empty for others.
std::vector<Footprint> footprint(const SceneRobot& robot) {
  std::vector<Footprint> parts;
  if (!as_planar(robot.model)) return parts;
  const Eigen::Isometry3d base = transform(robot.base);
  for (std::size_t i = 0; i < robot.model.links.size(); ++i) {
    const Eigen::Isometry3d X_WL = link_pose(robot.model, base, robot.q, static_cast<int>(i));
    for (const RobotGeom& geom : robot.model.links[i].geoms) {
      if (const auto part = footprint(X_WL * transform(geom.pose), geom)) parts.push_back(*part);
    }
  }
  return parts;
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

double footprint_gap(const std::vector<Footprint>& a, const std::vector<Footprint>& b) {
  double gap = std::numeric_limits<double>::infinity();
  for (const Footprint& one : a) {
    for (const Footprint& other : b) gap = std::min(gap, footprint_gap(one, other));
  }
  return gap;
}

// A field of a scene, as a file spells it and as people like to read it.
struct Field {
  std::string path;   // "objects[3].pose.x"
  std::string shown;  // "objects[3] ('can').pose.x"
};

// A field, its value and the closed range it must lie in.
struct Range {
  const char* field;
  double value, low, high;
  const char* unit;
};

// Collects what is wrong with a scene.
class Inspection {
 public:
  explicit Inspection(const Scene& scene) : scene_(scene), bounds_(scene.surface.bounds()) {}

  std::vector<SceneProblem> look() {
    look_at_surface();
    const bool is_robot_sound = look_at_robot();
    look_at_physics();
    for (std::size_t i = 0; i < scene_.fixtures.size(); ++i) look_at_fixture(i);
    for (std::size_t i = 0; i < scene_.objects.size(); ++i) look_at_object(i, is_robot_sound);
    look_at_task(is_robot_sound);
    return std::move(problems_);
  }

 private:
  void add(const Field& field, std::string text, bool is_relative = false) {
    constexpr std::size_t kMost = 1000;  // of a thousand objects in one place every pair is a problem
    if (problems_.size() >= kMost) return;
    problems_.push_back(
        {.path = field.path, .shown = field.shown, .text = std::move(text), .is_relative = is_relative});
  }
  void add_relative(const Field& field, std::string text) { add(field, std::move(text), true); }

  // Whether all lie in their ranges.
  bool check(const Field& parent, std::initializer_list<Range> ranges, bool is_relative = false) {
    bool are_fine = true;
    for (const Range& r : ranges) {
      if (r.value >= r.low && r.value <= r.high) continue;  // false for NaN
      are_fine = false;
      add({parent.path + r.field, parent.shown + r.field},
          fmt::format("got {}, wanted {} to {} {}", r.value, r.low, r.high, r.unit), is_relative);
    }
    return are_fine;
  }

  void look_at_surface() {
    const auto& parts = scene_.surface.parts;
    if (parts.empty()) return add({"surface", "surface"}, "got no part, wanted a rectangle");
    for (std::size_t i = 0; i < parts.size(); ++i) {
      const std::string field = parts.size() == 1 ? "surface." : fmt::format("surface.parts[{}].", i);
      check({field, field}, {{"size[0]", parts[i].size[0], 0.02, 10, "m"},
                             {"size[1]", parts[i].size[1], 0.02, 10, "m"},
                             {"x", parts[i].x, -10, 10, "m"},
                             {"y", parts[i].y, -10, 10, "m"}});
      for (std::size_t k = 0; k < i; ++k) {
        constexpr double kTouch = 1e-9;  // m; parts that share a side do not overlap
        const Rectangle &part = parts[i], &other = parts[k];
        if (std::min(part.high_x(), other.high_x()) - std::max(part.low_x(), other.low_x()) > kTouch &&
            std::min(part.high_y(), other.high_y()) - std::max(part.low_y(), other.low_y()) > kTouch) {
          add_relative({field, field},
                       fmt::format("overlaps part {}, wanted parts that meet at their sides: what stands on two would "
                                   "be held up twice",
                                   k));
        }
      }
    }
  }

  // Of an object or a fixture.
  template <class Body>
  void check_sizes(const Body& body, const Field& parent, double largest) {
    if (body.shape == Shape::kCylinder) {
      check(parent,
            {{"radius", body.radius, kSmallest, largest, "m"}, {"height", body.height, kSmallest, largest, "m"}});
    } else {
      check(parent, {{"size[0]", body.size[0], kSmallest, largest, "m"},
                     {"size[1]", body.size[1], kSmallest, largest, "m"},
                     {"size[2]", body.size[2], kSmallest, largest, "m"}});
    }
  }

  // `at`: the pose's own name, with a dot behind it.
  void check_pose(const Pose& pose, const Field& at) {
    const auto& [p, q] = pose;
    const double length = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
    check(at, {{"position[0]", p[0], -10, 10, "m"},
               {"position[1]", p[1], -10, 10, "m"},
               {"position[2]", p[2], -10, 10, "m"},
               {"orientation", length, 1 - 1e-6, 1 + 1e-6, "as the squared length of a unit quaternion"}});
  }

  void check_name(const std::string& name, const Field& parent) {
    const Field field{parent.path + "name", parent.shown + "name"};
    if (name.empty()) return add(field, "got '', wanted a name");
    if (!names_.insert(name).second) add(field, "already taken, wanted a unique name");
  }

  void look_at_fixture(std::size_t i) {
    const Fixture& fixture = scene_.fixtures[i];
    const Field parent{fmt::format("fixtures[{}].", i), fmt::format("fixtures[{}] ('{}').", i, fixture.name)};
    check_name(fixture.name, parent);
    check_sizes(fixture, parent, 10);
    check_pose(fixture.pose, {parent.path + "pose.", parent.shown + "pose."});
  }

  // Whether its model and its joints are such that its parts have places.
  bool look_at_robot() {
    const SceneRobot& robot = scene_.robot;
    if (auto ok = validate(robot.model); !ok) {
      const std::string& message = ok.error().message;  // "robot.links[2]…: got …"
      const std::size_t end = message.find(": ");
      const std::string shown = message.substr(0, end);
      add_relative({shown.substr(0, shown.find_first_of("[:")), shown},
                   end == message.npos ? "" : message.substr(end + 2));
      return false;
    }
    check_pose(robot.base, {"robot.base.", "robot.base."});
    if (as_planar(robot.model) && !(robot.base == Pose{})) {
      add({"robot.base", "robot.base"},
          "got a pose for a robot that moves in the surface's plane, wanted none: robot.start says where it is");
    }
    if (robot.q.size() != robot.model.joints.size()) {
      add({"robot.start", "robot.start"},
          fmt::format("got {} joints, wanted {}", robot.q.size(), robot.model.joints.size()));
      return false;
    }
    bool are_fine = true;
    for (std::size_t i = 0; i < robot.q.size(); ++i) {
      const Joint& joint = robot.model.joints[i];
      const std::string field = "robot.start." + joint.name;
      are_fine &= check({field, field}, {{"", robot.q[i], std::max(joint.low, -10.0), std::min(joint.high, 10.0),
                                          joint.kind == JointKind::kSlide ? "m" : "rad"}});
    }
    return are_fine;
  }

  void look_at_physics() {
    const ScenePhysics& physics = scene_.physics;
    const Field integrator{"physics.integrator", "physics.integrator"};
    if (physics.integrator != "euler" && physics.integrator != "rk4")
      add(integrator, fmt::format("got '{}', wanted one of: euler, rk4", physics.integrator));
    if (scene_.robot.model.carries_itself && physics.integrator == "rk4") {
      add(integrator, "got rk4 for a robot that carries itself, wanted euler: its weight is balanced once per step");
    }
    check({"physics.", "physics."}, {{"time_step", physics.time_step, 1e-4, 0.02, "s"},
                                     {"iterations", double(physics.iterations), 1, 1000, ""},
                                     {"tolerance", physics.tolerance, 0, 1, ""},
                                     {"contact_time", physics.contact_time,
                                      std::min(2 * physics.time_step, ScenePhysics::kSoftContact), 1, "s"}});
  }

  void look_at_object(std::size_t i, bool is_robot_sound) {
    const SceneObject& object = scene_.objects[i];
    const Field parent{fmt::format("objects[{}].", i), fmt::format("objects[{}] ('{}').", i, object.name)};
    const Field pose{parent.path + "pose", parent.shown + "pose"};
    check_name(object.name, parent);
    check_sizes(object, parent, kLargest);
    for (std::size_t k = 0; k < object.parts.size(); ++k) look_at_part(object, k, parent);
    check(parent, {{"mass", object.mass, 1e-4, 100, "kg"},
                   {"friction", object.friction, 0, 5, ""},
                   {"pose.yaw", object.yaw, -7, 7, "rad"}});
    const bool is_near = check(parent,
                               {{"pose.x", object.x, bounds_.low_x(), bounds_.high_x(), "m, on the surface"},
                                {"pose.y", object.y, bounds_.low_y(), bounds_.high_y(), "m, on the surface"}},
                               true);
    if (is_near && !scene_.surface.carries(object.x, object.y)) {
      add_relative(pose, fmt::format("({}, {}) is on no part of the surface, wanted one", object.x, object.y));
    }
    for (std::size_t j = 0; j < i; ++j) {
      const SceneObject& other = scene_.objects[j];
      if (!overlap(object, other)) continue;
      add_relative(pose, fmt::format("inside object '{}' by {:.1f} mm, wanted a free place", other.name,
                                     -1e3 * footprint_gap(footprints(object), footprints(other))));
    }
    if (is_robot_sound && overlaps_robot(scene_, object)) {
      add_relative(pose, "inside the robot at its start, wanted a free place; move robot.start or the object");
    }
  }

  void look_at_part(const SceneObject& object, std::size_t k, const Field& parent) {
    const ObjectPart& part = object.parts[k];
    const std::string name = fmt::format("parts[{}].", k);
    const Field field{parent.path + name, parent.shown + name};
    check_sizes(part, field, kLargest);
    check_pose(part.pose, {field.path + "pose.", field.shown + "pose."});
    const Eigen::Isometry3d X_BP = transform(part.pose);
    const double lowest = X_BP.translation().z() - half_extents(X_BP, part).z() + object.rest_height();
    if (lowest < 0) {
      add({field.path + "pose", field.shown + "pose"},
          fmt::format("reaches {:.1f} mm below what the object stands on, wanted a part above it", -1e3 * lowest));
    }
  }

  void look_at_task(bool is_robot_sound) {
    const SceneTask& task = scene_.task;
    const TaskKind* kind = find_task_kind(task.kind);
    if (!kind) {
      std::vector<std::string> known;
      for (const TaskKind* k : task_kinds()) known.emplace_back(k->name);
      add({"task.kind", "task.kind"}, fmt::format("got '{}', wanted one of: {}{}", task.kind, fmt::join(known, ", "),
                                                  did_you_mean(task.kind, known)));
    } else if (is_robot_sound) {
      if (const std::string misfit = kind->misfit(scene_); !misfit.empty())
        add_relative({"task.kind", "task.kind"}, misfit);
    }
    if (scene_.target() < 0) {
      std::vector<std::string> names;
      for (const SceneObject& object : scene_.objects) names.push_back(object.name);
      add_relative({"task.target", "task.target"}, fmt::format("got '{}', wanted the name of an object{}", task.target,
                                                               did_you_mean(task.target, names)));
    }
    if (kind && kind->has_goal) check_disc("task.goal", task.goal);
    if (task.obstacle) check_disc("task.obstacle", *task.obstacle);
  }

  void check_disc(const std::string& field, const Disc& disc) {
    check({field, field}, {{".radius", disc.radius, kSmallest, kLargest, "m"}});
    check({field, field},
          {{".x", disc.x, bounds_.low_x(), bounds_.high_x(), "m, on the surface"},
           {".y", disc.y, bounds_.low_y(), bounds_.high_y(), "m, on the surface"}},
          true);
  }

  const Scene& scene_;
  const Rectangle bounds_;
  std::set<std::string> names_;
  std::vector<SceneProblem> problems_;
};

constexpr double kPusherClearance = 0.001;  // m above the surface

const RobotModel& builtin(const char* name) {
  static std::map<std::string, RobotModel> models;
  static std::mutex mutex;  // guards models
  const std::lock_guard lock(mutex);
  const auto [model, is_new] = models.try_emplace(name);
  if (is_new) model->second = builtin_robot(name).value();  // a test reads every one of them
  return model->second;
}

}  // namespace

SceneRobot planar_gripper(const GripperStart& start) {
  return {.model = builtin("planar_gripper"),
          .q = {start.x, start.y, start.rotation, start.opening / 2, start.opening / 2}};
}

SceneRobot pusher(const PusherStart& start) {
  SceneRobot robot{.model = builtin("pusher"), .q = {start.x, start.y}};
  Link& link = robot.model.links[0];
  link.pose.position[2] = kPusherClearance + start.height / 2;
  link.geoms[0].radius = start.radius;
  link.geoms[0].height = start.height;
  return robot;
}

std::vector<Fixture> shelf_walls(const Rectangle& surface, double height) {
  constexpr double kThickness = 0.02;
  const double half_x = surface.size[0] / 2, half_y = surface.size[1] / 2;
  const auto wall = [&](const char* name, double x, double y, double size_x, double size_y) {
    return Fixture{.name = name,
                   .size = {size_x, size_y, height},
                   .pose = {.position = {surface.x + x, surface.y + y, height / 2}}};
  };
  return {wall("wall_back", half_x + kThickness / 2, 0, kThickness, surface.size[1] + 2 * kThickness),
          wall("wall_left", 0, half_y + kThickness / 2, surface.size[0], kThickness),
          wall("wall_right", 0, -half_y - kThickness / 2, surface.size[0], kThickness)};
}

double SceneObject::rest_height() const { return (shape == Shape::kBox ? size[2] : height) / 2; }

double SceneObject::top() const {
  double highest = rest_height();
  for (const ObjectPart& part : parts) {
    const Eigen::Isometry3d X_BP = transform(part.pose);
    highest = std::max(highest, X_BP.translation().z() + half_extents(X_BP, part).z());
  }
  return rest_height() + highest;
}

double SceneObject::reach() const {
  double farthest = shape == Shape::kBox ? std::hypot(size[0], size[1]) / 2 : radius;
  for (const ObjectPart& part : parts) {
    const Eigen::Isometry3d X_BP = transform(part.pose);
    const Footprint seen = seen_from_above(X_BP, part);
    const double c = std::cos(seen.yaw), s = std::sin(seen.yaw);
    const double along = std::abs(c * seen.x + s * seen.y), across = std::abs(c * seen.y - s * seen.x);
    const double beyond = seen.outline.radius > 0
                              ? std::hypot(along, across) + seen.outline.radius
                              : std::hypot(along + seen.outline.half_x, across + seen.outline.half_y);
    farthest = std::max(farthest, beyond);
  }
  return farthest;
}

void SceneObject::scale(double factor) {
  const auto scale_body = [factor](auto& body) {
    for (double& extent : body.size) extent *= factor;
    body.radius *= factor;
    body.height *= factor;
  };
  scale_body(*this);
  for (ObjectPart& part : parts) {
    scale_body(part);
    for (double& coordinate : part.pose.position) coordinate *= factor;
  }
}

int Scene::target() const {
  const auto found = std::ranges::find(objects, task.target, &SceneObject::name);
  return found == objects.end() ? -1 : static_cast<int>(found - objects.begin());
}

double signed_distance(const SceneObject& object, const Disc& disc) {
  const Footprint area = footprint(disc);
  const Footprint own{.x = object.x, .y = object.y, .yaw = object.yaw, .outline = outline(object)};
  if (object.parts.empty()) return disc_gap(area, own);
  return footprint_gap({area}, footprints(object));
}

bool overlap(const SceneObject& a, const SceneObject& b, double gap) {
  return footprint_gap(footprints(a), footprints(b)) < gap;
}

bool overlaps_robot(const Scene& scene, const SceneObject& object, double gap) {
  return footprint_gap(footprint(scene.robot), footprints(object)) < gap;
}

bool is_free(const Scene& scene, const SceneObject& object, double gap) {
  const auto meets = [&](const Fixture& fixture) {
    const auto part = footprint(fixture, object.top());
    return part && footprint_gap({*part}, footprints(object)) < gap;
  };
  return !overlaps_robot(scene, object, gap) && std::ranges::none_of(scene.fixtures, meets) &&
         std::ranges::none_of(scene.objects, [&](const SceneObject& other) { return overlap(object, other, gap); });
}

Result<void> validate(const Scene& scene, const std::string& origin) {
  return validate(scene, [&](std::string_view) { return origin; });
}

Result<void> validate(const Scene& scene, const Locate& locate) {
  const std::vector<SceneProblem> problems = scene_problems(scene);
  if (problems.empty()) return {};
  constexpr std::size_t kMostTold = 20;
  std::string message;
  for (std::size_t i = 0; i < std::min(problems.size(), kMostTold); ++i) {
    const auto& [path, shown, text, is_relative] = problems[i];
    message += fmt::format("{}{}: {}: {}", i == 0 ? "" : "\n", locate(path), shown, text);
  }
  if (problems.size() > kMostTold) message += fmt::format("\nand {} more", problems.size() - kMostTold);
  return Error{Code::kInvalidArgument, message};
}

std::vector<SceneProblem> scene_problems(const Scene& scene) { return Inspection(scene).look(); }

StateLayout layout_of(const Scene& scene) {
  StateLayout layout;
  for (const Joint& joint : scene.robot.model.joints) layout.joints.push_back(joint.name);
  layout.nu = static_cast<int>(scene.robot.model.axes.size());
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
  State state{.q = scene.robot.q};
  for (const SceneObject& object : scene.objects) {
    state.q.insert(state.q.end(), {object.x, object.y, object.rest_height(), std::cos(object.yaw / 2), 0, 0,
                                   std::sin(object.yaw / 2)});
  }
  state.v.assign(static_cast<std::size_t>(layout_of(scene).nv), 0.0);
  return state;
}

}  // namespace jostle::physics_pool
