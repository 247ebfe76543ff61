// jostle scene: makes, checks, disturbs and shows scene files.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <iterator>
#include <optional>
#include <utility>

#include "physics_pool/robot/kinematics.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "physics_pool/scenarios/push.hpp"
#include "physics_pool/scene/scene.hpp"
#include "physics_pool/scene/task_kind.hpp"
#include "physics_pool/uncertainty/belief.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"

namespace jostle::tools {
namespace {

using physics_pool::Scene;
using physics_pool::SceneObject;

const std::string kStandardOutput = "-";

struct Arguments {
  int chapter = 3;
  physics_pool::GenerateOptions generate;
  physics_pool::GeneratePushOptions push;
  std::optional<int> objects;  // 15 of Chapter 3, 3 of Chapter 7
  std::string shape = "cylinder";
  std::string input, output = kStandardOutput;
  std::string uncertainty = "low";
  std::uint64_t seed = 1;
};

Result<void> write(const std::string& file, const std::string& text) {
  if (file == kStandardOutput) {
    if (std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0) return {};
    return Error{Code::kIo, "standard output: cannot be written"};
  }
  return common::write_text(file, text);
}

Result<Scene> make_scene(Arguments arguments) {
  if (arguments.chapter == 3) {
    arguments.generate.objects = arguments.objects.value_or(arguments.generate.objects);
    return physics_pool::generate_chapter3(arguments.generate);
  }
  arguments.push.seed = arguments.generate.seed;
  arguments.push.shape = arguments.shape == "box" ? physics_pool::Shape::kBox : physics_pool::Shape::kCylinder;
  if (arguments.chapter == 6) {
    if (arguments.objects.value_or(0) == 0) return physics_pool::generate_chapter6(arguments.push);
    return Error{Code::kInvalidArgument,
                 fmt::format("--objects: got {}, wanted 0 of Chapter 6, or --chapter 7", *arguments.objects)};
  }
  arguments.push.objects = arguments.objects.value_or(arguments.push.objects);
  return physics_pool::generate_chapter7(arguments.push);
}

// The commands give the text that is to be written: all that goes wrong in them is bad input.

Result<std::string> generate(const Arguments& arguments) {
  auto scene_result = make_scene(arguments);
  if (!scene_result) return scene_result.error();
  return to_yaml(*scene_result, physics_pool::RobotText::kByName);
}

Result<std::string> check(const Arguments& arguments) {
  const auto scene_result = physics_pool::load_scene(arguments.input);
  if (!scene_result) return scene_result.error();
  return fmt::format("ok {}\n", to_string(scene_hash(*scene_result)));
}

Result<std::string> perturb(const Arguments& arguments) {
  const auto level_result = physics_pool::parse_uncertainty(arguments.uncertainty);
  if (!level_result) return level_result.error();
  const auto scene_result = physics_pool::load_scene(arguments.input);
  if (!scene_result) return scene_result.error();
  return to_yaml(physics_pool::perturb(*scene_result, *level_result, arguments.seed), physics_pool::RobotText::kByName);
}

const char* word(physics_pool::Shape shape) { return shape == physics_pool::Shape::kBox ? "box" : "cylinder"; }

// Of an object or a fixture.
template <class Body>
std::string size_text(const Body& body) {
  if (body.shape == physics_pool::Shape::kBox) {
    return fmt::format("{:.1f} x {:.1f} x {:.1f}", 1e3 * body.size[0], 1e3 * body.size[1], 1e3 * body.size[2]);
  }
  return fmt::format("r {:.1f}, h {:.1f}", 1e3 * body.radius, 1e3 * body.height);
}

Result<std::string> show(const Arguments& arguments) {
  const auto scene_result = physics_pool::load_scene(arguments.input);
  if (!scene_result) return scene_result.error();
  const Scene& scene = *scene_result;
  std::string text;
  const auto print = [&text]<class... T>(fmt::format_string<T...> format, T&&... values) {
    fmt::format_to(std::back_inserter(text), format, std::forward<T>(values)...);
  };
  print("{}  {}\n", scene.name, to_string(scene_hash(scene)));
  const physics_pool::Rectangle bounds = scene.surface.bounds();
  const Eigen::Vector3d tool =
      physics_pool::tool_pose(scene.robot.model, transform(scene.robot.base), scene.robot.q).translation();
  print("surface {} x {} m{}, {} at x {:.3f}, y {:.3f}, z {:.3f} m, time step {} s, {} '{}'\n", bounds.size[0],
        bounds.size[1], scene.surface.parts.size() > 1 ? fmt::format(" in {} parts", scene.surface.parts.size()) : "",
        scene.robot.model.name, tool.x(), tool.y(), tool.z(), scene.physics.time_step, scene.task.kind,
        scene.task.target);
  std::vector<std::string> axes;
  for (const physics_pool::Axis& axis : scene.robot.model.axes) axes.push_back(axis.name);
  print("robot: {} joints, controls {}\n\n", scene.robot.model.joints.size(), fmt::join(axes, ", "));
  const auto show_disc = [&](const char* name, const physics_pool::Disc& disc) {
    print("{:16} {:9} {:20} {:>8} {:>9} {:>8.3f} {:>8.3f}\n", name, "disc", fmt::format("r {:.1f}", 1e3 * disc.radius),
          "", "", disc.x, disc.y);
  };
  print("{:16} {:9} {:20} {:>8} {:>9} {:>8} {:>8} {:>8}\n", "name", "shape", "size mm", "mass kg", "friction", "x m",
        "y m", "yaw rad");
  for (const SceneObject& object : scene.objects) {
    print("{:16} {:9} {:20} {:>8.3f} {:>9.3f} {:>8.3f} {:>8.3f} {:>8.3f}\n", object.name, word(object.shape),
          size_text(object), object.mass, object.friction, object.x, object.y, object.yaw);
  }
  for (const physics_pool::Fixture& fixture : scene.fixtures) {
    print("{:16} {:9} {:20} {:>8} {:>9} {:>8.3f} {:>8.3f}\n", fixture.name, word(fixture.shape), size_text(fixture),
          "fixed", "", fixture.pose.position[0], fixture.pose.position[1]);
  }
  if (physics_pool::find_task_kind(scene.task.kind)->has_goal) show_disc("(goal)", scene.task.goal);
  if (scene.task.obstacle) show_disc("(obstacle)", *scene.task.obstacle);
  return text;
}

using Command = Result<std::string> (*)(const Arguments&);

void add_input(CLI::App& command, Arguments& arguments) {
  command.add_option("file", arguments.input, "a scene file")->required();
}

void add_output(CLI::App& command, Arguments& arguments) {
  command.add_option("-o,--output", arguments.output, "file to write; - is the standard output")->capture_default_str();
}

// Adds the four commands; whichever is given ends up in `chosen`.
void add_commands(CLI::App& app, Arguments& arguments, Command& chosen) {
  const auto command = [&](const char* name, const char* purpose, Command work) {
    CLI::App* added = app.add_subcommand(name, purpose);
    added->callback([&chosen, work] { chosen = work; });
    return added;
  };
  CLI::App* generates = command("generate", "make a random scene of the thesis", generate);
  generates
      ->add_option("--chapter", arguments.chapter,
                   "whose scenes: 3, Sec. 3.3.1, grasping; 6, Sec. 6.3.3, pushing round an obstacle; 7, "
                   "Sec. 7.4, pushing among sliders")
      ->check(CLI::IsMember({3, 6, 7}))
      ->capture_default_str();
  generates->add_option("--seed", arguments.generate.seed, "equal seeds give equal scenes")->capture_default_str();
  generates->add_option(
      "--objects", arguments.objects,
      "objects beside the target: 0 to 40, default 15, of Chapter 3; 0 to 3, default 3, of Chapter 7");
  generates
      ->add_option("--table", arguments.generate.table,
                   "side of the table of Chapter 3, m; 0: 0.6, larger for more than 15 objects")
      ->capture_default_str();
  generates->add_option("--shape", arguments.shape, "of the sliders of Chapters 6 and 7: cylinder or box")
      ->check(CLI::IsMember({"cylinder", "box"}))
      ->capture_default_str();
  generates
      ->add_option("--integrator", arguments.push.integrator,
                   "of Chapters 6 and 7: euler, or rk4, the thesis's, at four times the work")
      ->check(CLI::IsMember({"euler", "rk4"}))
      ->capture_default_str();
  add_output(*generates, arguments);

  add_input(*command("check", "say ok and the scene's hash, or what is wrong", check), arguments);

  CLI::App* perturbs = command("perturb", "make a planner's uncertain belief of a scene", perturb);
  add_input(*perturbs, arguments);
  perturbs->add_option("--uncertainty", arguments.uncertainty, "none, low, medium or high")
      ->check(CLI::IsMember({"none", "low", "medium", "high"}))
      ->capture_default_str();
  perturbs->add_option("--seed", arguments.seed, "equal seeds give equal beliefs")->capture_default_str();
  add_output(*perturbs, arguments);

  add_input(*command("show", "list the objects of a scene", show), arguments);
}

}  // namespace
}  // namespace jostle::tools

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::tools;
  Arguments arguments;
  Command chosen = nullptr;
  CLI::App app{"Makes, checks, disturbs and shows scene files.", "jostle scene"};
  app.require_subcommand(1);
  add_commands(app, arguments, chosen);
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  const auto text_result = chosen(arguments);
  if (!text_result) {
    fmt::print(stderr, "jostle scene: {}\n", text_result.error().message);
    return common::kExitUsage;
  }
  if (auto ok = write(arguments.output, *text_result); !ok) {
    fmt::print(stderr, "jostle scene: {}\n", ok.error().message);
    return common::kExitFailed;
  }
  return common::kExitOk;
}
