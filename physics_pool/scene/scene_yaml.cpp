// Scenes as text.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iterator>

#include "idl/files/files.hpp"
#include "idl/text/yaml_fields.hpp"
#include "physics_pool/robot/pose_text.hpp"
#include "physics_pool/scene/scene.hpp"
#include "physics_pool/scene/scene_problems.hpp"
#include "physics_pool/scene/task_kind.hpp"

namespace jostle::physics_pool {
namespace {

using yaml::Fields;
using yaml::quoted;

void read_disc(Fields& fields, Disc& disc) {
  fields.required("x", disc.x);
  fields.required("y", disc.y);
  fields.required("radius", disc.radius);
}

// Format 1 knew two robots, one table or a shelf round the origin.
void read_surface_1(Fields& surface, Scene& scene) {
  bool is_shelf = false;
  double wall_height = 0.15;
  surface.choice<bool>("kind", is_shelf, {{"table", false}, {"shelf", true}});
  surface.numbers("size", scene.surface.parts[0].size, false);
  surface.optional("wall_height", wall_height);
  if (is_shelf) scene.fixtures = shelf_walls(scene.surface.parts[0], wall_height);
}

// In the words of format 1: what these numbers become has other names.
void check_1(const Fields& fields, const char* key, double value, double low, double high) {
  if (value >= low && value <= high) return;
  fields.refuse(key, fmt::format("got {}, wanted {} to {} m", value, low, high));
}

void read_robot_1(Fields& fields, Scene& scene) {
  enum class Model { kGripper, kPusher } model = Model::kGripper;
  GripperStart gripper_start;
  PusherStart pusher_start;
  fields.choice<Model>("model", model, {{"planar_gripper", Model::kGripper}, {"pusher", Model::kPusher}});
  fields.section("start", false, [&](Fields& start) {
    start.optional("x", gripper_start.x);
    start.optional("y", gripper_start.y);
    start.optional("rotation", gripper_start.rotation);
    start.optional("opening", gripper_start.opening);
    check_1(start, "opening", gripper_start.opening, 0, 0.085);
  });
  fields.optional("radius", pusher_start.radius);
  fields.optional("height", pusher_start.height);
  check_1(fields, "radius", pusher_start.radius, 0.002, 2);
  check_1(fields, "height", pusher_start.height, 0.002, 2);
  pusher_start.x = gripper_start.x;
  pusher_start.y = gripper_start.y;
  scene.robot = model == Model::kPusher ? pusher(pusher_start) : planar_gripper(gripper_start);
}

void read_surface(Fields& fields, Scene& scene) {
  const auto part = [](Fields& in, Rectangle& rectangle) {
    in.optional("x", rectangle.x);
    in.optional("y", rectangle.y);
    in.numbers("size", rectangle.size, true);
  };
  if (fields.has("parts")) {
    scene.surface.parts.clear();
    fields.list("parts", [&](Fields& in) { part(in, scene.surface.parts.emplace_back()); });
  } else {
    part(fields, scene.surface.parts[0]);
  }
}

void read_pose(Fields& in, Pose& pose) {
  double yaw = 0.0;
  in.numbers("position", pose.position, true);
  in.optional("yaw", yaw);
  if (yaw != 0) pose.orientation = turned_about_z(yaw);
  in.numbers("orientation", pose.orientation, false);
}

// Of an object or a fixture.
template <class Body>
void read_shape(Fields& in, Body& body) {
  if (!in.choice<Shape>("shape", body.shape, {{"box", Shape::kBox}, {"cylinder", Shape::kCylinder}}))
    return in.skip({"size", "radius", "height"});
  if (body.shape == Shape::kBox) {
    in.numbers("size", body.size, true);
  } else {
    in.required("radius", body.radius);
    in.required("height", body.height);
  }
}

Fixture read_fixture(Fields& in) {
  Fixture fixture;
  in.required("name", fixture.name);
  read_shape(in, fixture);
  in.section("pose", true, [&](Fields& pose) { read_pose(pose, fixture.pose); });
  return fixture;
}

void read_robot_2(Fields& fields, Scene& scene, const RobotPath& robots) {
  if (fields.is_mapping("model")) {
    fields.section("model", true, [&](Fields& model) { scene.robot.model = read_robot(model); });
  } else {
    std::string name = "planar_gripper";
    fields.optional("model", name);
    auto model_result = find_robot(name, robots);
    if (!model_result) fields.refuse("model", model_result.error().message);
    scene.robot.model = std::move(model_result).value();
  }
  fields.section("base", false, [&](Fields& base) { read_pose(base, scene.robot.base); });
  scene.robot.q = scene.robot.model.start();
  std::vector<std::pair<std::string, double>> start;
  fields.pairs("start", start);
  for (const auto& [name, value] : start) {
    const auto joint = std::ranges::find(scene.robot.model.joints, name, &Joint::name);
    if (joint == scene.robot.model.joints.end()) {
      std::vector<std::string> known;
      for (const Joint& j : scene.robot.model.joints) known.push_back(j.name);
      fields.refuse("start", fmt::format("got joint '{}', wanted one of: {}", name, fmt::join(known, ", ")));
    }
    scene.robot.q[static_cast<std::size_t>(joint - scene.robot.model.joints.begin())] = value;
  }
}

Scene read(Fields& fields, const RobotPath& robots) {
  Scene scene;
  int version = 0;
  fields.required("jostle_scene", version);
  if (fields.is_sound() && version != 1 && version != 2)
    fields.refuse("jostle_scene", fmt::format("got version {}, wanted 2 or 1", version));
  fields.optional("name", scene.name);
  fields.section("surface", false, [&](Fields& surface) {
    version == 1 ? read_surface_1(surface, scene) : read_surface(surface, scene);
  });
  if (version == 2)
    fields.optional_list("fixtures", [&](Fields& entry) { scene.fixtures.push_back(read_fixture(entry)); });
  fields.section("robot", false, [&](Fields& robot) {
    version == 1 ? read_robot_1(robot, scene) : read_robot_2(robot, scene, robots);
  });
  fields.list("objects", [&](Fields& entry) {
    SceneObject object;
    entry.required("name", object.name);
    read_shape(entry, object);
    entry.optional_list("parts", [&](Fields& piece) {
      ObjectPart part;
      read_shape(piece, part);
      piece.section("pose", true, [&](Fields& pose) { read_pose(pose, part.pose); });
      object.parts.push_back(part);
    });
    entry.required("mass", object.mass);
    entry.required("friction", object.friction);
    entry.section("pose", true, [&](Fields& pose) {
      pose.required("x", object.x);
      pose.required("y", object.y);
      pose.optional("yaw", object.yaw);
    });
    scene.objects.push_back(std::move(object));
  });
  fields.section("task", true, [&](Fields& task) {
    task.optional("kind", scene.task.kind);
    task.required("target", scene.task.target);
    const TaskKind* kind = find_task_kind(scene.task.kind);
    task.section("goal", kind && kind->has_goal, [&](Fields& goal) { read_disc(goal, scene.task.goal); });
    task.section("obstacle", false, [&](Fields& obstacle) { read_disc(obstacle, scene.task.obstacle.emplace()); });
  });
  fields.section("physics", false, [&](Fields& physics) {
    physics.optional("time_step", scene.physics.time_step);
    physics.optional("integrator", scene.physics.integrator);
    physics.optional("iterations", scene.physics.iterations);
    physics.optional("tolerance", scene.physics.tolerance);
    physics.optional("contact_time", scene.physics.contact_time);
  });
  return scene;
}

// Adds what is wrong with the values, but for what may follow from what could not be read.
void add_problems(const YAML::Node& root, const Scene& scene, yaml::Complaints& complaints) {
  const yaml::Complaints unreadable = complaints;
  const bool is_whole = unreadable.empty();
  for (const SceneProblem& problem : scene_problems(scene)) {
    if (problem.is_relative ? is_whole : unreadable.is_sound(problem.path))
      complaints.add(yaml::line_of(root, problem.path), problem.path, problem.text, problem.shown);
  }
}

// The lines of `read_shape`.
template <class Body>
std::string shape_text(const Body& body) {
  if (body.shape == Shape::kBox) return fmt::format("    shape: box\n    size: [{}]\n", fmt::join(body.size, ", "));
  return fmt::format("    shape: cylinder\n    radius: {}\n    height: {}\n", body.radius, body.height);
}

}  // namespace

Result<Scene> parse_scene(std::string_view text, const std::string& origin, const RobotPath& robots) {
  return yaml::parse<Scene>(text, origin, [&](const YAML::Node& root) -> Result<Scene> {
    Fields fields(root, "", origin);
    Scene scene = read(fields, robots);
    add_problems(root, scene, fields.complaints());
    fields.finish();
    return scene;
  });
}

Result<Scene> load_scene(const std::filesystem::path& file) {
  const bool is_input = files::is_standard(file);
  const auto text_result = files::read(file, files::kMostText);
  if (!text_result) {
    return Error{text_result.error().code,
                 text_result.error().message + "; wanted a scene file, which `jostle scene generate` makes"};
  }
  return parse_scene(*text_result, is_input ? "standard input" : file.string(),
                     robot_path(is_input ? "" : file.parent_path()));
}

std::string to_yaml(const Scene& scene, RobotText robot_text_as) {
  // fmt's {} is the shortest text that reads back to the same double.
  std::string text;
  const auto line = [&]<class... T>(fmt::format_string<T...> format, T&&... values) {
    fmt::format_to(std::back_inserter(text), format, std::forward<T>(values)...);
    text += '\n';
  };
  line("jostle_scene: 2");
  line("name: {}", quoted(scene.name));
  line("surface:");
  line("  parts:");
  for (const Rectangle& part : scene.surface.parts) {
    line("    - {{x: {}, y: {}, size: [{}, {}]}}", part.x, part.y, part.size[0], part.size[1]);
  }
  if (!scene.fixtures.empty()) line("fixtures:");
  for (const Fixture& fixture : scene.fixtures) {
    line("  - name: {}", quoted(fixture.name));
    text += shape_text(fixture);
    line("    pose: {}", pose_text(fixture.pose));
  }
  line("robot:");
  const auto known_result = builtin_robot(scene.robot.model.name);
  if (robot_text_as == RobotText::kByName && known_result && *known_result == scene.robot.model) {
    line("  model: {}", scene.robot.model.name);
  } else {
    line("  model:");
    text += robot_text(scene.robot.model, 4);
  }
  line("  base: {}", pose_text(scene.robot.base));
  line("  start:");
  for (std::size_t i = 0; i < scene.robot.q.size(); ++i) {
    line("    {}: {}", quoted(scene.robot.model.joints[i].name), scene.robot.q[i]);
  }
  line("objects:");
  for (const SceneObject& object : scene.objects) {
    line("  - name: {}", quoted(object.name));
    text += shape_text(object);
    line("    mass: {}", object.mass);
    line("    friction: {}", object.friction);
    line("    pose: {{x: {}, y: {}, yaw: {}}}", object.x, object.y, object.yaw);
    if (!object.parts.empty()) line("    parts:");
    for (const ObjectPart& part : object.parts) {
      if (part.shape == Shape::kBox) {
        line("      - {{shape: box, size: [{}], pose: {}}}", fmt::join(part.size, ", "), pose_text(part.pose));
      } else {
        line("      - {{shape: cylinder, radius: {}, height: {}, pose: {}}}", part.radius, part.height,
             pose_text(part.pose));
      }
    }
  }
  line("task:");
  line("  kind: {}", scene.task.kind);
  line("  target: {}", quoted(scene.task.target));
  const auto disc = [&](const char* key, const Disc& area) {
    line("  {}: {{x: {}, y: {}, radius: {}}}", key, area.x, area.y, area.radius);
  };
  if (const TaskKind* kind = find_task_kind(scene.task.kind); kind && kind->has_goal) disc("goal", scene.task.goal);
  if (scene.task.obstacle) disc("obstacle", *scene.task.obstacle);
  const ScenePhysics& physics = scene.physics;
  // Scenes that do not say how hard contacts are have the hashes that they had before it could be said.
  line("physics: {{time_step: {}, integrator: {}, iterations: {}, tolerance: {}{}}}", physics.time_step,
       physics.integrator, physics.iterations, physics.tolerance,
       physics.contact_time == ScenePhysics::kSoftContact ? ""
                                                          : fmt::format(", contact_time: {}", physics.contact_time));
  return text;
}

Hash scene_hash(const Scene& scene) { return hash_of(to_yaml(scene)); }

}  // namespace jostle::physics_pool
