// jostle scene: makes, checks, disturbs and shows scene files.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iterator>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "physics_pool/robot/kinematics.hpp"
#include "physics_pool/scenarios/chapter3.hpp"
#include "physics_pool/scenarios/chapter4.hpp"
#include "physics_pool/scenarios/chapter5.hpp"
#include "physics_pool/scenarios/push.hpp"
#include "physics_pool/scene/scene.hpp"
#include "physics_pool/scene/task_kind.hpp"
#include "physics_pool/uncertainty/belief.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"

namespace jostle::tools {
namespace {

using physics_pool::Scene;
using physics_pool::SceneObject;

struct Arguments {
  int chapter = 3;
  CLI::App* generates = nullptr;  // to see which options were given
  physics_pool::GenerateOptions generate;
  physics_pool::GenerateAdaptiveOptions adaptive;
  physics_pool::GeneratePushOptions push;
  std::optional<int> objects;  // 15 of Chapter 3, 9 of Chapter 4, 8 of Chapter 5, 3 of Chapter 7
  std::string task = "wide";
  std::string robot = "ur5_2f85";
  std::string shape = "cylinder";
  std::string input, output = "-";
  std::vector<std::string> inputs;
  bool as_json = false;
  std::string uncertainty = "low";
  std::uint64_t seed = 1;
};

// Options that mean nothing for the scenes of a chapter are refused, not ignored.
Result<void> check_chapter(const Arguments& arguments) {
  struct Own {
    const char* option;
    std::vector<int> chapters;  // whose scenes it means something for
  };
  for (const Own& own : {Own{"--table", {3}}, Own{"--robot", {4}}, Own{"--task", {5}}, Own{"--shape", {6, 7}},
                         Own{"--integrator", {6, 7}}}) {
    if (arguments.generates->count(own.option) == 0 || std::ranges::count(own.chapters, arguments.chapter) > 0)
      continue;
    return invalid(own.option, fmt::format("it for scenes of Chapter {}", arguments.chapter),
                   fmt::format("--chapter {} with it", fmt::join(own.chapters, " or ")));
  }
  return {};
}

Result<Scene> make_scene(Arguments arguments) {
  if (auto ok = check_chapter(arguments); !ok) return ok.error();
  if (arguments.chapter == 3) {
    arguments.generate.objects = arguments.objects.value_or(arguments.generate.objects);
    return physics_pool::generate_chapter3(arguments.generate);
  }
  if (arguments.chapter == 4) {
    physics_pool::GenerateShelfOptions shelf{.seed = arguments.generate.seed};
    shelf.objects = arguments.objects.value_or(shelf.objects);
    return arguments.robot == "ur5_2f85" ? physics_pool::generate_chapter4_arm(shelf)
                                         : physics_pool::generate_chapter4(shelf);
  }
  if (arguments.chapter == 5) {
    using physics_pool::AdaptiveTask;
    arguments.adaptive.task = physics_pool::parse_adaptive_task(arguments.task).value_or(AdaptiveTask::kWide);
    arguments.adaptive.seed = arguments.generate.seed;
    if (arguments.adaptive.task != AdaptiveTask::kClutter && arguments.objects.value_or(0) > 0)
      return invalid("--objects", std::to_string(*arguments.objects), "0, or --task clutter with it");
    arguments.adaptive.objects = arguments.objects.value_or(arguments.adaptive.objects);
    return physics_pool::generate_chapter5(arguments.adaptive);
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

// The commands give the text that is to be written.

Result<std::string> generate(const Arguments& arguments) {
  auto scene_result = make_scene(arguments);
  if (!scene_result) return scene_result.error();
  return to_yaml(*scene_result, physics_pool::RobotText::kByName);
}

// Widths at the target's narrowest, seen from above, against the hand at its widest.
void warn_of_target(const std::string& file, const Scene& scene) {
  const auto& hand = scene.robot.model.hand;
  if (scene.task.kind != "grasp" || !hand) return;
  const SceneObject& target = scene.objects[static_cast<std::size_t>(scene.target())];
  const double width =
      target.shape == physics_pool::Shape::kBox ? std::min(target.size[0], target.size[1]) : 2 * target.radius;
  if (width < hand->stroke) return;
  fmt::print(stderr,
             "jostle scene: warning: {}: the target '{}' is {:.1f} mm wide, the hand opens to {:.1f} mm: it cannot be "
             "grasped\n",
             file, target.name, 1e3 * width, 1e3 * hand->stroke);
}

// All files are looked at, whatever is wrong with the first.
Result<std::string> check(const Arguments& arguments) {
  std::string text, problems;
  for (const std::string& file : arguments.inputs) {
    const auto scene_result = physics_pool::load_scene(file);
    if (!scene_result) {
      problems += (problems.empty() ? "" : "\n") + scene_result.error().message;
      continue;
    }
    warn_of_target(file, *scene_result);
    text += arguments.inputs.size() == 1 ? "" : file + ": ";
    text += fmt::format("ok {}\n", to_string(scene_hash(*scene_result)));
  }
  if (problems.empty()) return text;
  fmt::print("{}", text);  // those that are fine
  return Error{Code::kInvalidArgument, problems};
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

template <class Body>
nlohmann::json size_json(const Body& body) {
  if (body.shape == physics_pool::Shape::kBox) return {{"shape", "box"}, {"size", body.size}};
  return {{"shape", "cylinder"}, {"radius", body.radius}, {"height", body.height}};
}

nlohmann::json to_json(const Scene& scene) {
  nlohmann::json json{{"name", scene.name},
                      {"hash", to_string(scene_hash(scene))},
                      {"surface", nlohmann::json::array()},
                      {"fixtures", nlohmann::json::array()},
                      {"objects", nlohmann::json::array()},
                      {"time_step", scene.physics.time_step},
                      {"integrator", scene.physics.integrator}};
  for (const auto& part : scene.surface.parts)
    json["surface"].push_back({{"x", part.x}, {"y", part.y}, {"size", part.size}});
  for (const auto& fixture : scene.fixtures) {
    json["fixtures"].push_back(size_json(fixture));
    json["fixtures"].back().update(
        {{"name", fixture.name}, {"position", fixture.pose.position}, {"orientation", fixture.pose.orientation}});
  }
  for (const SceneObject& object : scene.objects) {
    json["objects"].push_back(size_json(object));
    json["objects"].back().update({{"name", object.name},
                                   {"mass", object.mass},
                                   {"friction", object.friction},
                                   {"x", object.x},
                                   {"y", object.y},
                                   {"yaw", object.yaw}});
    for (const physics_pool::ObjectPart& part : object.parts) {
      nlohmann::json piece = size_json(part);
      piece.update({{"position", part.pose.position}, {"orientation", part.pose.orientation}});
      json["objects"].back()["parts"].push_back(std::move(piece));
    }
  }
  auto& robot = json["robot"];
  robot = {
      {"model", scene.robot.model.name}, {"start", nlohmann::json::object()}, {"controls", nlohmann::json::array()}};
  for (std::size_t i = 0; i < scene.robot.q.size(); ++i)
    robot["start"][scene.robot.model.joints[i].name] = scene.robot.q[i];
  for (const physics_pool::Axis& axis : scene.robot.model.axes) robot["controls"].push_back(axis.name);
  json["task"] = {{"kind", scene.task.kind}, {"target", scene.task.target}};
  const auto disc = [](const physics_pool::Disc& d) {
    return nlohmann::json{{"x", d.x}, {"y", d.y}, {"radius", d.radius}};
  };
  if (physics_pool::find_task_kind(scene.task.kind)->has_goal) json["task"]["goal"] = disc(scene.task.goal);
  if (scene.task.obstacle) json["task"]["obstacle"] = disc(*scene.task.obstacle);
  return json;
}

Result<std::string> show(const Arguments& arguments) {
  const auto scene_result = physics_pool::load_scene(arguments.input);
  if (!scene_result) return scene_result.error();
  const Scene& scene = *scene_result;
  if (arguments.as_json) return to_json(scene).dump(1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
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
    for (const physics_pool::ObjectPart& part : object.parts)
      print("{:16} {:9} {}\n", "", word(part.shape), size_text(part));
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
  command.add_option("file", arguments.input, "a scene file; - is standard input")->required();
}

void add_output(CLI::App& command, Arguments& arguments) {
  command.add_option("-o,--output", arguments.output, "file to write; - is standard output")->capture_default_str();
}

// Adds the four commands; whichever is given ends up in `chosen`.
void add_commands(CLI::App& app, Arguments& arguments, Command& chosen) {
  const auto command = [&](const char* name, const char* purpose, Command work) {
    CLI::App* added = app.add_subcommand(name, purpose);
    added->callback([&chosen, work] { chosen = work; });
    return added;
  };
  CLI::App* generates = command("generate", "make a random scene of the thesis", generate);
  arguments.generates = generates;
  generates
      ->add_option("--chapter", arguments.chapter,
                   "whose scenes: 3, Sec. 3.3.1, grasping; 4, Sec. 4.5.3, the same in a shelf; 5, Sec. 5.6, tasks of "
                   "different accuracy; 6, Sec. 6.3.3, pushing round an obstacle; 7, Sec. 7.4, pushing among sliders")
      ->check(CLI::IsMember({3, 4, 5, 6, 7}))
      ->capture_default_str();
  common::add_seed_option(*generates, "--seed", arguments.generate.seed, "equal seeds give equal scenes");
  generates->add_option("--objects", arguments.objects,
                        "objects beside the target: 0 to 40, default 15, of Chapter 3; 2 to 15, default 9, of Chapter "
                        "4; 0 to 20, default 8, of the clutter of Chapter 5; "
                        "0 to 3, default 3, of Chapter 7");
  generates
      ->add_option("--task", arguments.task,
                   "of Chapter 5: wide, a wide table and a large goal region; strip, a thin strip and a small one; "
                   "changing, the one and then the other; l, two strips at a right angle; clutter, a grasp")
      ->check(CLI::IsMember({"wide", "strip", "changing", "l", "clutter"}))
      ->capture_default_str();
  generates->add_option("--robot", arguments.robot, "of Chapter 4: ur5_2f85, an arm, or planar_gripper")
      ->check(CLI::IsMember({"ur5_2f85", "planar_gripper"}))
      ->capture_default_str();
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

  command("check", "say ok and the scene's hash, or everything that is wrong", check)
      ->add_option("files", arguments.inputs, "scene files; - is standard input")
      ->required();

  CLI::App* perturbs = command("perturb", "make a planner's uncertain belief of a scene", perturb);
  add_input(*perturbs, arguments);
  perturbs->add_option("--uncertainty", arguments.uncertainty, "none, low, medium or high")
      ->check(CLI::IsMember({"none", "low", "medium", "high"}))
      ->capture_default_str();
  common::add_seed_option(*perturbs, "--seed", arguments.seed, "equal seeds give equal beliefs");
  add_output(*perturbs, arguments);

  CLI::App* shows = command("show", "list the objects of a scene", show);
  add_input(*shows, arguments);
  shows->add_flag("--json", arguments.as_json, "as an object, in metres, kilograms and radians");
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
  app.footer(common::exit_codes_help());
  add_commands(app, arguments, chosen);
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  const auto fail = [](const Error& error) {
    fmt::print(stderr, "jostle scene: {}\n", error.message);
    return common::exit_code_of(error);
  };
  if (auto ok = common::check_outputs({{.option = "--output", .path = arguments.output, .endings = {}}}); !ok)
    return fail(ok.error());
  const auto text_result = chosen(arguments);
  if (!text_result) return fail(text_result.error());
  if (auto ok = common::write_text(arguments.output, *text_result); !ok) return fail(ok.error());
  return common::kExitOk;
}
