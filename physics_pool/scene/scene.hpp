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

namespace jostle::physics_pool {

enum class Shape { kBox, kCylinder };

/// A rigid body that can be pushed. Frame B at its centre, z up at rest.
struct SceneObject {
  std::string name;
  Shape shape = Shape::kBox;
  std::array<double, 3> size{};  ///< box: full extents x, y, z, m
  double radius = 0.0;           ///< cylinder, m
  double height = 0.0;           ///< cylinder, m
  double mass = 0.0;             ///< kg
  double friction = 0.0;         ///< Coulomb coefficient against everything
  double x = 0.0, y = 0.0;       ///< p_WoBo_W in the surface's plane, m
  double yaw = 0.0;              ///< rad about z

  /// m; how far the centre is above the surface at rest.
  double rest_height() const;
};

/// The supporting surface, centred at the world's origin, top at z = 0. A shelf
/// has walls on every side but -x, where the robot reaches in.
struct Surface {
  enum class Kind { kTable, kShelf };
  Kind kind = Kind::kTable;
  std::array<double, 2> size{0.6, 0.6};  ///< full extents x, y, m
  double wall_height = 0.15;             ///< m, shelf only
};

/// What moves at a fixed height above the surface, driven by velocities:
///
///   planar_gripper  its origin G is the point of Fig. 3.2: the middle of the
///                   palm's face, x forward
///   pusher          an upright cylinder (Sec. 6.1) that has no rotation
struct SceneRobot {
  std::string model = "planar_gripper";
  double x = -0.3, y = 0.0;  ///< start of G, or of the pusher's axis, m
  double rotation = 0.0;     ///< rad about z; 0 looks along +x; gripper only
  double opening = 0.085;    ///< m between the fingers; gripper only
  double radius = 0.0145;    ///< m, pusher only
  double height = 0.11;      ///< m, pusher only

  bool is_pusher() const { return model == "pusher"; }
};

/// A disc on the surface.
struct Disc {
  double x = 0.0, y = 0.0, radius = 0.0;  // m
};

/// What is to be done with the target:
///
///   grasp  bring it into the hand (Ch. 3)
///   push   bring its centre into the goal region (Sec. 6.2, 7.1), neither it nor
///          the pusher over the obstacle, nothing else into the region
struct SceneTask {
  std::string kind = "grasp";
  std::string target;            ///< name of an object
  Disc goal{.radius = 0.04};     ///< push only
  std::optional<Disc> obstacle;  ///< push only; a keep-out area, not a body

  bool is_push() const { return kind == "push"; }
};

/// Engine options; part of the world's identity.
struct ScenePhysics {
  double time_step = 0.002;  ///< s
  /// "euler" (semi-implicit), or "rk4", four times the work per step, as in Ch. 6.
  std::string integrator = "euler";
  int iterations = 50;  ///< Newton iterations at most
  double tolerance = 1e-8;
};

struct Scene {
  std::string name;
  Surface surface;
  SceneRobot robot;
  std::vector<SceneObject> objects;
  SceneTask task;
  ScenePhysics physics;

  /// Index of the target in objects, or -1.
  int target() const;
};

/// Reads and checks a scene.
/// Errors   kIo, kInvalidArgument; the message names file, line, field, got and wanted.
Result<Scene> load_scene(const std::filesystem::path& file);
Result<Scene> parse_scene(std::string_view yaml, const std::string& origin);

/// The canonical text: equal scenes give equal text, and reading it back gives
/// the same scene bit for bit.
std::string to_yaml(const Scene& scene);

/// Hash of the canonical text; the name of the world compiled from it.
Hash scene_hash(const Scene& scene);

/// Sizes and masses in range, names unique, target and robot known, nothing
/// inside anything else, everything on the surface.
Result<void> validate(const Scene& scene, const std::string& origin);

/// Where a field such as "objects[3].pose.x" came from, for messages: a file,
/// or file and line.
using Locate = std::function<std::string(std::string_view field)>;
Result<void> validate(const Scene& scene, const Locate& locate);

/// Signed distance between the footprints of an object and a disc, m; negative
/// inside. Of boxes that overlap, how far they would have to part.
double signed_distance(const SceneObject& object, const Disc& disc);

/// Whether the footprints of two objects come closer than `gap` metres.
bool overlap(const SceneObject& a, const SceneObject& b, double gap = 0.0);

/// Whether an object is inside the robot's start pose, or closer than `gap` metres.
bool overlaps_robot(const Scene& scene, const SceneObject& object, double gap = 0.0);

/// Whether an object would find its place free: nothing of the scene is nearer than `gap` metres.
bool is_free(const Scene& scene, const SceneObject& object, double gap);

/// Parts of a State for this scene, and the state at its start: at rest.
StateLayout layout_of(const Scene& scene);
State initial_state(const Scene& scene);

}  // namespace jostle::physics_pool
