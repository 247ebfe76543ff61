#pragma once
/// \file
/// Scenes: what is where, as data. `scenes/README.md` documents the file format.

#include <array>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "idl/types/hash.hpp"
#include "idl/types/result.hpp"
#include "idl/types/state.hpp"
#include "physics_pool/robot/robot_model.hpp"
#include "physics_pool/robot/robot_yaml.hpp"
#include "physics_pool/scene/surface.hpp"

namespace jostle::physics_pool {

enum class Shape { kBox, kCylinder };

/// A piece that an object has beside its own shape, fixed to it: a mug's handle, a bowl's wall.
struct ObjectPart {
  Shape shape = Shape::kBox;
  std::array<double, 3> size{};  ///< box: full extents x, y, z, m
  double radius = 0.0;           ///< cylinder, m
  double height = 0.0;           ///< cylinder, m
  Pose pose;                     ///< X_BP of its centre, in the object's frame

  bool operator==(const ObjectPart&) const = default;
};

/// A rigid body that can be pushed: a box or a cylinder that stands on the surface, and what is fixed to it. Frame B at
/// the centre of the shape it stands on, z up at rest.
struct SceneObject {
  std::string name;
  Shape shape = Shape::kBox;
  std::array<double, 3> size{};  ///< box: full extents x, y, z, m
  double radius = 0.0;           ///< cylinder, m
  double height = 0.0;           ///< cylinder, m
  double mass = 0.0;             ///< kg, of all of it
  double friction = 0.0;         ///< Coulomb coefficient against everything
  double x = 0.0, y = 0.0;       ///< p_WoBo_W in the surface's plane, m
  double yaw = 0.0;              ///< rad about z
  std::vector<ObjectPart> parts;

  /// Returns how far the centre is above the surface at rest, m.
  double rest_height() const;
  /// Returns how far the highest point is above the surface at rest, m.
  double top() const;
  /// Returns the radius of the smallest disc about the centre that holds all of it, seen from above, m.
  double reach() const;
  /// Multiplies all lengths of a compound by a factor, so that it stays in one piece.
  void scale(double factor);
};

/// A body that never moves: a shelf's board, a wall, a box that stands in the way.
struct Fixture {
  std::string name;
  Shape shape = Shape::kBox;
  std::array<double, 3> size{};  ///< box: full extents x, y, z, m
  double radius = 0.0;           ///< cylinder, m
  double height = 0.0;           ///< cylinder, m
  Pose pose;                     ///< X_WF of its centre

  bool operator==(const Fixture&) const = default;
};

/// The walls of a shelf, 2 cm thick, on every side of a rectangle but -x, where the robot reaches in.
std::vector<Fixture> shelf_walls(const Rectangle& surface, double height);

/// The robot, where it is mounted, and where it starts.
struct SceneRobot {
  RobotModel model;
  Pose base;              ///< X_WB
  std::vector<double> q;  ///< [joints] at the start, m or rad

  bool operator==(const SceneRobot&) const = default;
};

/// Start of the planar gripper: where the middle of its palm's face is (point G of Fig. 3.2).
struct GripperStart {
  double x = -0.3, y = 0.0;  ///< m
  double rotation = 0.0;     ///< rad about z; 0 looks along +x
  double opening = 0.085;    ///< m between the fingers
};
SceneRobot planar_gripper(const GripperStart& start = {});

/// Start and measures of the pusher, an upright cylinder (Sec. 6.1).
struct PusherStart {
  double x = -0.3, y = 0.0;  ///< of its axis, m
  double radius = 0.0145;    ///< m
  double height = 0.11;      ///< m
};
SceneRobot pusher(const PusherStart& start = {});

/// A disc on the surface.
struct Disc {
  double x = 0.0, y = 0.0, radius = 0.0;  // m
};

/// What is to be done with the target. physics_pool/task has the table of kinds and what each means.
struct SceneTask {
  std::string kind = "grasp";
  std::string target;            ///< name of an object
  Disc goal{.radius = 0.04};     ///< where a kind has a goal region
  std::optional<Disc> obstacle;  ///< a keep-out area, not a body
};

/// Engine options; part of the world's identity.
struct ScenePhysics {
  double time_step = 0.002;  ///< s
  /// "euler" (semi-implicit), or "rk4", four times the work per step, as in Ch. 6.
  std::string integrator = "euler";
  int iterations = 50;  ///< Newton iterations at most
  double tolerance = 1e-8;
  /// s, in which bodies that are in each other part; stable from 2 time steps on. What is hit at speed v is entered by
  /// about a third of v times this.
  double contact_time = kSoftContact;

  static constexpr double kSoftContact = 0.02;  ///< s, the engine's own
};

struct Scene {
  std::string name;
  Surface surface;
  std::vector<Fixture> fixtures;
  SceneRobot robot = planar_gripper();
  std::vector<SceneObject> objects;
  SceneTask task;
  ScenePhysics physics;

  /// Returns the index of the target in objects, or -1.
  int target() const;
};

/// Reads and checks a scene of format 2, or 1 (scenes/README.md has both).
/// `robots`: where a robot that the text names is looked for; by default only built-in models are found.
/// `file`: - is standard input. Texts have at most files::kMostText bytes.
/// Errors   kNotFound, kInvalidArgument; the message names file, line, field, got and wanted of all mistakes, as far as
/// they do not follow from one another.
Result<Scene> load_scene(const std::filesystem::path& file);
Result<Scene> parse_scene(std::string_view yaml, const std::string& origin, const RobotPath& robots = {});

/// How a scene's text holds its robot: whole, or, if it is a built-in model, by its name.
enum class RobotText { kWhole, kByName };

/// The canonical text: equal scenes give equal text, and reading it back gives the same scene bit for bit. It holds
/// the robot whole, so that whoever has the text needs no other file.
std::string to_yaml(const Scene& scene, RobotText robot = RobotText::kWhole);

/// Returns the hash of the canonical text: the name of the world compiled from it.
Hash scene_hash(const Scene& scene);

/// Checks that sizes and masses are in range, names unique, target and robot known, nothing
/// inside anything else, everything on the surface. The Error has a line for everything that is wrong.
Result<void> validate(const Scene& scene, const std::string& origin);

/// Where a field such as "objects[3].pose.x" came from, for messages: a file,
/// or file and line.
using Locate = std::function<std::string(std::string_view field)>;
Result<void> validate(const Scene& scene, const Locate& locate);

/// Returns the distance between the footprints of an object and a disc, m. Where they overlap it is
/// negative: how far they would have to part.
double signed_distance(const SceneObject& object, const Disc& disc);

/// Whether the footprints of two objects come closer than `gap` metres.
bool overlap(const SceneObject& a, const SceneObject& b, double gap = 0.0);

/// Whether an object is inside the robot's start pose as seen from above, or closer than `gap` metres. Never so for
/// robots other than those that move in the plane: the engine checks arms (World::compile).
bool overlaps_robot(const Scene& scene, const SceneObject& object, double gap = 0.0);

/// Whether an object would find its place free: nothing of the scene is nearer than `gap` metres.
bool is_free(const Scene& scene, const SceneObject& object, double gap);

/// These return the layout of this scene's states, and the state at its start, at rest.
StateLayout layout_of(const Scene& scene);
State initial_state(const Scene& scene);

}  // namespace jostle::physics_pool
