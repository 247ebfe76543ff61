#include "physics_pool/local/model_xml.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numbers>
#include <numeric>
#include <vector>

#include "idl/types/transform.hpp"
#include "physics_pool/local/engine.hpp"

namespace jostle::physics_pool {
namespace {

// Collision masks: a pair meets if one's contype shares a bit with the other's
// conaffinity. Objects meet everything; the robot meets walls and objects; frozen
// objects meet the robot and free objects, but neither support nor each other.
constexpr int kSupport = 1, kMovable = 2, kRobot = 4, kWall = 8;

constexpr int kContactsOfParts = 64;  // of walls and handles, which touch two bodies at a time

constexpr double kFloor = -0.75;  // m, where dropped objects end

// Names of users, inside XML's double quotes.
std::string quoted(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if (c == '&') {
      safe += "&amp;";
    } else if (c == '<') {
      safe += "&lt;";
    } else if (c == '"') {
      safe += "&quot;";
    } else {
      safe += c;
    }
  }
  return safe;
}

class Writer {
 public:
  template <class... T>
  void line(fmt::format_string<T...> format, T&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<T>(values)...);
    text_ += '\n';
  }
  std::string take() { return std::move(text_); }

 private:
  std::string text_;
};

void write_meshes(Writer& xml, const RobotModel& robot);

// Light, colours, sky and the robot's meshes.
void write_looks(Writer& xml, const Scene& scene, bool sky) {
  xml.line(R"(<statistic center="0 0 0" extent="1"/>)");
  xml.line(
      R"(<visual><global offwidth="1280" offheight="960"/><quality shadowsize="4096"/><map znear="0.02" zfar="20" shadowclip="1.2"/><headlight ambient="0.42 0.42 0.43" diffuse="0.22 0.22 0.22" specular="0.05 0.05 0.05"/></visual>)");
  xml.line("<asset>");
  if (sky)
    xml.line(
        R"(<texture name="sky" type="skybox" builtin="gradient" rgb1="0.97 0.98 0.99" rgb2="0.86 0.89 0.92" width="256" height="256"/>)");
  xml.line(R"(<material name="floor" rgba="0.80 0.82 0.84 1" specular="0" reflectance="0"/>)");
  xml.line(R"(<material name="wood" rgba="0.84 0.77 0.66 1" specular="0.05"/>)");
  xml.line(R"(<material name="steel" rgba="0.58 0.60 0.63 1" specular="0.4"/>)");
  xml.line(R"(<material name="dark" rgba="0.40 0.41 0.44 1" specular="0.3"/>)");
  xml.line(R"(<material name="arm" rgba="0.68 0.71 0.74 1" specular="0.3"/>)");
  write_meshes(xml, scene.robot.model);
  xml.line("</asset>");
}

// A camera at `eye` that looks at `at`, its picture's upper edge level.
void write_camera(Writer& xml, const char* name, const std::array<double, 3>& eye, const std::array<double, 3>& at,
                  double fovy_deg) {
  const double x = eye[0] - at[0], y = eye[1] - at[1], z = eye[2] - at[2];
  const double level = std::hypot(x, y);
  xml.line(R"(<camera name="{}" pos="{} {} {}" xyaxes="{} {} 0 {} {} {}" fovy="{}"/>)", name, eye[0], eye[1], eye[2],
           -y / level, x / level, -x * z / level, -y * z / level, level, fovy_deg);
}

// Cameras and light that fit the surface, and a hand in front of it.
void write_view(Writer& xml, const Scene& scene) {
  // The cameras were placed for the table of Sec. 3.3.1; what stands around it needs more room.
  const Rectangle bounds = scene.surface.bounds();
  const double walls = scene.fixtures.empty() ? 0.0 : 0.06;
  const double scale = (std::max(bounds.size[0], bounds.size[1]) + walls) / 0.6;
  xml.line(
      R"(<light pos="-0.9 -0.1 2.0" dir="0.48 0.16 -1" directional="true" diffuse="0.55 0.55 0.54" specular="0.25 0.25 0.25"/>)");
  const auto camera = [&](const char* name, std::array<double, 3> eye, std::array<double, 3> at, double fovy_deg) {
    eye[0] += bounds.x, eye[1] += bounds.y, at[0] += bounds.x, at[1] += bounds.y;
    write_camera(xml, name, eye, at, fovy_deg);
  };
  if (!as_planar(scene.robot.model)) {
    // An arm stands beside the surface and reaches over it.
    camera("overview", {-0.55 * scale, -1.3 * scale, 1.15 * scale}, {-0.05 * scale, 0.0, 0.2 * scale}, 42);
    camera("top", {0.0, -0.01 * scale, 2.2 * scale}, {0.0, 0.0, 0.0}, 40);
    return;
  }
  if (!scene.robot.model.hand) {
    // A surface of 1.0 m x 0.8 m fills the picture.
    const double size = std::max(bounds.size[0], bounds.size[1] / 0.8) + walls;
    camera("overview", {-0.1 * size, -0.82 * size, 1.16 * size}, {0.01 * size, -0.05 * size, 0.0}, 36);
    camera("top", {0.0, -0.01 * size, 1.3 * size}, {0.0, 0.0, 0.0}, 40);
    return;
  }
  camera("overview", {-0.15 * scale, -0.66 * scale, 1.00 * scale}, {-0.07 * scale, -0.025 * scale, 0.0}, 36);
  camera("top", {-0.1 * scale, -0.01 * scale, 1.2 * scale}, {-0.1 * scale, 0.0, 0.0}, 40);
}

void write_surface(Writer& xml, const Surface& surface) {
  xml.line(
      R"(<geom name="floor" type="plane" pos="0 0 {}" size="3 3 1" material="floor" contype="{}" conaffinity="0" user="{}"/>)",
      kFloor, kSupport, kFloorMark);
  for (std::size_t i = 0; i < surface.parts.size(); ++i) {
    const Rectangle& part = surface.parts[i];
    const double half_x = part.size[0] / 2, half_y = part.size[1] / 2;
    xml.line(
        R"(<geom name="surface{}" type="plane" pos="{} {} 0" size="{} {} 1" rgba="0 0 0 0" contype="{}" conaffinity="0" user="{}"/>)",
        i, part.x, part.y, half_x, half_y, kSupport, kSurfaceMark);
    // What one sees of the table; the plane above is what things stand on.
    xml.line(
        R"(<geom name="table{}" type="box" pos="{} {} -0.02" size="{} {} 0.0199" material="wood" contype="0" conaffinity="0"/>)",
        i, part.x, part.y, half_x, half_y);
  }
}

std::string pose_text(const Pose& pose) {
  return fmt::format(R"(pos="{}" quat="{}")", fmt::join(pose.position, " "), fmt::join(pose.orientation, " "));
}

// Of an object or a fixture.
template <class Body>
std::string shape_text(const Body& body) {
  if (body.shape == Shape::kCylinder) {
    return fmt::format(R"(type="cylinder" size="{} {}")", body.radius, body.height / 2);
  }
  return fmt::format(R"(type="box" size="{} {} {}")", body.size[0] / 2, body.size[1] / 2, body.size[2] / 2);
}

void write_fixture(Writer& xml, const Fixture& fixture) {
  xml.line(R"(<geom name="{}{}" {} {} rgba="0.6 0.5 0.4 0.5" contype="{}" conaffinity="0" user="{}"/>)", kGeomPrefix,
           quoted(fixture.name), shape_text(fixture), pose_text(fixture.pose), kSupport | kWall, kFixtureMark);
}

// Meshes by number, in the order in which write_robot meets them.
void write_meshes(Writer& xml, const RobotModel& robot) {
  int number = 0;
  for (const Link& link : robot.links) {
    for (const RobotGeom& geom : link.geoms) {
      if (geom.shape != GeomShape::kMesh) continue;
      xml.line(R"(<mesh name="mesh{}" vertex="{}"/>)", number++, fmt::join(geom.vertices, " "));
    }
  }
}

void write_joint(Writer& xml, const Joint& joint) {
  xml.line(R"(<joint name="{}" type="{}" axis="{}"{} armature="{}"/>)", quoted(joint.name),
           joint.kind == JointKind::kSlide ? "slide" : "hinge", fmt::join(joint.axis, " "),
           joint.is_limited() ? fmt::format(R"( range="{} {}" limited="true")", joint.low, joint.high) : "",
           joint.armature);
}

void write_geom(Writer& xml, const RobotGeom& geom, bool has_mass, int& mesh) {
  std::string shape;
  switch (geom.shape) {
    case GeomShape::kBox:
      shape = fmt::format(R"(type="box" size="{} {} {}")", geom.size[0] / 2, geom.size[1] / 2, geom.size[2] / 2);
      break;
    case GeomShape::kCylinder:
      shape = fmt::format(R"(type="cylinder" size="{} {}")", geom.radius, geom.height / 2);
      break;
    case GeomShape::kSphere:
      shape = fmt::format(R"(type="sphere" size="{}")", geom.radius);
      break;
    case GeomShape::kMesh:
      shape = fmt::format(R"(type="mesh" mesh="mesh{}")", mesh++);
      break;
  }
  xml.line(R"(<geom{} {} {}{} material="{}" contype="{}" conaffinity="{}" user="{}"/>)",
           geom.name.empty() ? "" : fmt::format(R"( name="{}{}")", kGeomPrefix, quoted(geom.name)), shape,
           pose_text(geom.pose), has_mass ? fmt::format(R"( mass="{}")", geom.mass) : "", geom.material, kRobot, kWall,
           kRobotMark);
}

// xx, yy, zz, xy, xz, yz along the link's axes: the engine takes a full matrix in no other frame.
std::array<double, 6> moments_in_link(const Inertia& inertia) {
  const auto& [xx, yy, zz, xy, xz, yz] = inertia.moments;
  Eigen::Matrix3d I;
  I << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  const Eigen::Matrix3d R = transform(inertia.pose).linear();
  I = (R * I * R.transpose()).eval();
  return {I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)};
}

void write_link(Writer& xml, const RobotModel& robot, int index, const Pose& place, int& mesh) {
  const Link& link = robot.links[static_cast<std::size_t>(index)];
  xml.line(R"(<body name="{}{}" {}>)", kLinkPrefix, quoted(link.name), pose_text(place));
  for (const int joint : link.joints) write_joint(xml, robot.joints[static_cast<std::size_t>(joint)]);
  if (link.inertia) {
    xml.line(R"(<inertial pos="{}" mass="{}" fullinertia="{}"/>)", fmt::join(link.inertia->pose.position, " "),
             link.inertia->mass, fmt::join(moments_in_link(*link.inertia), " "));
  }
  for (const RobotGeom& geom : link.geoms) write_geom(xml, geom, !link.inertia, mesh);
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const Link& child = robot.links[i];
    if (child.parent == index) write_link(xml, robot, static_cast<int>(i), child.pose, mesh);
  }
  xml.line("</body>");
}

// The robot's first link where the base puts it. Joints come in the order of the model, as children follow parents.
void write_robot(Writer& xml, const SceneRobot& robot) {
  int mesh = 0;
  for (std::size_t i = 0; i < robot.model.links.size(); ++i) {
    const Link& link = robot.model.links[i];
    if (link.parent >= 0) continue;
    Pose place = link.pose;
    if (!(robot.base == Pose{})) {
      place = pose_of(transform(robot.base) * transform(link.pose));
    }
    write_link(xml, robot.model, static_cast<int>(i), place, mesh);
  }
}

// Shares of an object's mass, as volumes are: of its own shape, then of its parts.
std::vector<double> masses(const SceneObject& object) {
  const auto volume = [](const auto& body) {
    return body.shape == Shape::kBox ? body.size[0] * body.size[1] * body.size[2]
                                     : std::numbers::pi * body.radius * body.radius * body.height;
  };
  std::vector<double> shares{volume(object)};
  for (const ObjectPart& part : object.parts) shares.push_back(volume(part));
  const double whole = std::accumulate(shares.begin(), shares.end(), 0.0);
  for (double& share : shares) share = object.mass * (share / whole);
  return shares;
}

// `geoms`: at least so many; what an object lacks of them touches nothing.
void write_object(Writer& xml, const SceneObject& object, bool is_target, bool is_free, std::size_t geoms) {
  // Muted, distinct colours for clutter; the target is the green one.
  static constexpr std::array kPalette{"0.75 0.32 0.27 1", "0.30 0.47 0.71 1", "0.85 0.62 0.27 1", "0.54 0.40 0.66 1",
                                       "0.45 0.60 0.65 1"};
  const std::size_t colour = std::hash<std::string>{}(object.name) % kPalette.size();
  xml.line(R"(<body pos="{} {} {}" quat="{} 0 0 {}" mocap="{}">)", object.x, object.y, object.rest_height(),
           std::cos(object.yaw / 2), std::sin(object.yaw / 2), !is_free);
  if (is_free) xml.line("<freejoint/>");
  // The object's friction is the one that counts against everything softer in
  // priority; between two objects the engine takes the larger one.
  const auto geom = [&](const std::string& shape, double mass) {
    xml.line(
        R"(<geom {} mass="{}" friction="{} 0.005 0.0001" condim="3" priority="1" rgba="{}" contype="{}" conaffinity="{}"/>)",
        shape, mass, object.friction, is_target ? "0.20 0.65 0.30 1" : kPalette[colour], is_free ? kMovable : 0,
        (is_free ? kSupport : 0) | kMovable | kRobot);
  };
  if (object.parts.empty()) {
    geom(shape_text(object), object.mass);
  } else {
    const std::vector<double> shares = masses(object);
    geom(shape_text(object), shares[0]);
    for (std::size_t k = 0; k < object.parts.size(); ++k) {
      geom(fmt::format("{} {}", shape_text(object.parts[k]), pose_text(object.parts[k].pose)), shares[k + 1]);
    }
  }
  for (std::size_t k = object.parts.size() + 1; k < geoms; ++k) {
    xml.line(R"(<geom type="box" size="0.001 0.001 0.001" mass="0" contype="0" conaffinity="0"/>)");
  }
  xml.line("</body>");
}

void write_drive(Writer& xml, const Joint& joint) {
  xml.line(R"(<velocity joint="{}" kv="{}" forcelimited="true" forcerange="{} {}"/>)", quoted(joint.name), joint.gain,
           -joint.force_limit, joint.force_limit);
}

}  // namespace

std::size_t most_geoms(const Scene& scene) {
  std::size_t most = 1;
  for (const SceneObject& object : scene.objects) most = std::max(most, object.parts.size() + 1);
  return most;
}

std::string model_xml(const Scene& scene, const ModelContent& content) {
  const int objects = static_cast<int>(scene.objects.size());
  const int free = std::min(content.free, objects);
  // Four points under each object and as many with neighbours; a pyramid cone has
  // four rows per point. Pushed clutter of 6 to 31 objects was measured to have 4.3
  // contacts per object at most. Scratch memory grows with the square of the rows.
  const std::size_t geoms = most_geoms(scene);
  const int contacts = 8 * free + 32 + (geoms > 1 ? kContactsOfParts : 0);
  Writer xml;
  xml.line(R"(<mujoco model="jostle">)");
  xml.line(R"(<compiler angle="radian" boundmass="0" autolimits="false"/>)");
  xml.line(
      R"(<option timestep="{}" iterations="{}" tolerance="{}" solver="Newton" jacobian="sparse" cone="pyramidal" integrator="{}"/>)",
      scene.physics.time_step, scene.physics.iterations, scene.physics.tolerance,
      scene.physics.integrator == "rk4" ? "RK4" : "Euler");
  xml.line(R"(<size nconmax="{}" njmax="{}" nuser_geom="1"/>)", contacts, 4 * contacts + 8);
  if (scene.physics.contact_time != ScenePhysics::kSoftContact)
    xml.line(R"(<default><geom solref="{} 1"/></default>)", scene.physics.contact_time);
  write_looks(xml, scene, content.looks);
  xml.line("<worldbody>");
  write_view(xml, scene);
  write_surface(xml, scene.surface);
  for (const Fixture& fixture : scene.fixtures) write_fixture(xml, fixture);
  write_robot(xml, scene.robot);
  for (int i = 0; i < objects; ++i) {
    write_object(xml, scene.objects[static_cast<std::size_t>(i)], i == scene.target(), i < free,
                 free < objects ? geoms : 0);
  }
  xml.line("</worldbody>");
  xml.line("<actuator>");
  for (const Joint& joint : scene.robot.model.joints) {
    if (joint.gain > 0) write_drive(xml, joint);
  }
  xml.line("</actuator>");
  xml.line("</mujoco>");
  return xml.take();
}

}  // namespace jostle::physics_pool
