// Scenes as text.

#include <fmt/format.h>
#include <fstream>
#include <iterator>
#include <sstream>

#include "idl/text/yaml_fields.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {
namespace {

using yaml::Fields;
using yaml::Malformed;

void read_disc(Fields& fields, Disc& disc) {
  fields.required("x", disc.x);
  fields.required("y", disc.y);
  fields.required("radius", disc.radius);
}

Scene read(const YAML::Node& root, const std::string& origin) {
  Scene scene;
  Fields fields(root, "", origin);
  int version = 0;
  fields.required("jostle_scene", version);
  if (version != 1) {
    throw Malformed{fmt::format("{}:{}: jostle_scene: got version {}, wanted 1", origin,
                                yaml::line_of(root, "jostle_scene"), version)};
  }
  fields.optional("name", scene.name);
  fields.section("surface", false, [&](Fields& surface) {
    surface.choice<Surface::Kind>("kind", scene.surface.kind,
                                  {{"table", Surface::Kind::kTable}, {"shelf", Surface::Kind::kShelf}});
    surface.numbers("size", scene.surface.size, false);
    surface.optional("wall_height", scene.surface.wall_height);
  });
  fields.section("robot", false, [&](Fields& robot) {
    robot.optional("model", scene.robot.model);
    robot.section("start", false, [&](Fields& start) {
      start.optional("x", scene.robot.x);
      start.optional("y", scene.robot.y);
      start.optional("rotation", scene.robot.rotation);
      start.optional("opening", scene.robot.opening);
    });
    robot.optional("radius", scene.robot.radius);
    robot.optional("height", scene.robot.height);
  });
  fields.list("objects", [&](Fields& entry) {
    SceneObject object;
    entry.required("name", object.name);
    entry.choice<Shape>("shape", object.shape, {{"box", Shape::kBox}, {"cylinder", Shape::kCylinder}});
    if (object.shape == Shape::kBox) {
      entry.numbers("size", object.size, true);
    } else {
      entry.required("radius", object.radius);
      entry.required("height", object.height);
    }
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
    task.section("goal", scene.task.is_push(), [&](Fields& goal) { read_disc(goal, scene.task.goal); });
    task.section("obstacle", false, [&](Fields& obstacle) { read_disc(obstacle, scene.task.obstacle.emplace()); });
  });
  fields.section("physics", false, [&](Fields& physics) {
    physics.optional("time_step", scene.physics.time_step);
    physics.optional("integrator", scene.physics.integrator);
    physics.optional("iterations", scene.physics.iterations);
    physics.optional("tolerance", scene.physics.tolerance);
  });
  fields.finish();
  return scene;
}

// Quotes as YAML (and JSON) do, so that any name survives.
std::string quoted(const std::string& text) {
  YAML::Emitter out;
  out << YAML::DoubleQuoted << text;
  return out.c_str();
}

}  // namespace

Result<Scene> parse_scene(std::string_view text, const std::string& origin) {
  return yaml::parse<Scene>(text, origin, [&](const YAML::Node& root) -> Result<Scene> {
    Scene scene = read(root, origin);
    const auto locate = [&](std::string_view field) {
      return fmt::format("{}:{}", origin, yaml::line_of(root, field));
    };
    if (auto ok = validate(scene, locate); !ok) return ok.error();
    return scene;
  });
}

Result<Scene> load_scene(const std::filesystem::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  if (!in || !(text << in.rdbuf())) {
    return Error{Code::kIo, fmt::format("{}: cannot be read, wanted a scene file; `jostle scene "
                                        "generate` makes one",
                                        file.string())};
  }
  return parse_scene(text.str(), file.string());
}

std::string to_yaml(const Scene& scene) {
  // fmt's {} is the shortest text that reads back to the same double.
  std::string text;
  const auto line = [&]<class... T>(fmt::format_string<T...> format, T&&... values) {
    fmt::format_to(std::back_inserter(text), format, std::forward<T>(values)...);
    text += '\n';
  };
  line("jostle_scene: 1");
  line("name: {}", quoted(scene.name));
  line("surface:");
  line("  kind: {}", scene.surface.kind == Surface::Kind::kTable ? "table" : "shelf");
  line("  size: [{}, {}]", scene.surface.size[0], scene.surface.size[1]);
  line("  wall_height: {}", scene.surface.wall_height);
  line("robot:");
  line("  model: {}", quoted(scene.robot.model));
  if (scene.robot.is_pusher()) {
    line("  start: {{x: {}, y: {}}}", scene.robot.x, scene.robot.y);
    line("  radius: {}", scene.robot.radius);
    line("  height: {}", scene.robot.height);
  } else {
    line("  start: {{x: {}, y: {}, rotation: {}, opening: {}}}", scene.robot.x, scene.robot.y, scene.robot.rotation,
         scene.robot.opening);
  }
  line("objects:");
  for (const SceneObject& object : scene.objects) {
    line("  - name: {}", quoted(object.name));
    if (object.shape == Shape::kBox) {
      line("    shape: box");
      line("    size: [{}, {}, {}]", object.size[0], object.size[1], object.size[2]);
    } else {
      line("    shape: cylinder");
      line("    radius: {}", object.radius);
      line("    height: {}", object.height);
    }
    line("    mass: {}", object.mass);
    line("    friction: {}", object.friction);
    line("    pose: {{x: {}, y: {}, yaw: {}}}", object.x, object.y, object.yaw);
  }
  line("task:");
  line("  kind: {}", scene.task.kind);
  line("  target: {}", quoted(scene.task.target));
  const auto disc = [&](const char* key, const Disc& area) {
    line("  {}: {{x: {}, y: {}, radius: {}}}", key, area.x, area.y, area.radius);
  };
  if (scene.task.is_push()) disc("goal", scene.task.goal);
  if (scene.task.obstacle) disc("obstacle", *scene.task.obstacle);
  line("physics: {{time_step: {}, integrator: {}, iterations: {}, tolerance: {}}}", scene.physics.time_step,
       scene.physics.integrator, scene.physics.iterations, scene.physics.tolerance);
  return text;
}

Hash scene_hash(const Scene& scene) { return hash_of(to_yaml(scene)); }

}  // namespace jostle::physics_pool
