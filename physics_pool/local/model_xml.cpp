#include "physics_pool/local/model_xml.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "physics_pool/local/engine.hpp"
#include "physics_pool/scene/planar_gripper.hpp"

namespace jostle::physics_pool {
namespace {

namespace hand = planar_gripper;

// Collision masks: a pair meets if one's contype shares a bit with the other's
// conaffinity. Objects meet everything; the robot meets walls and objects; frozen
// objects meet the robot and free objects, but neither support nor each other.
constexpr int kSupport = 1, kMovable = 2, kRobot = 4, kWall = 8;

// The robot is velocity controlled: force = kv·(u - v). The engine treats it
// explicitly, so kv·h must stay well below the inertia behind it: with h = 2 ms
// and a time constant of inertia/kv = 10 ms the ratio is 0.2.
struct Drive {
  double inertia;  // kg or kg m^2, armature of the joint
  double gain;     // N s/m or N m s/rad
  double limit;    // N or N m
};
constexpr Drive kBaseDrive{20.0, 2000.0, 200.0};  // arm and base behind the hand
constexpr Drive kWristDrive{0.5, 50.0, 28.0};     // limit: UR5 wrist
constexpr Drive kFingerDrive{1.0, 100.0, 100.0};  // limit: middle of 20-235 N

// What holds the pusher is heavy and stiff against what it pushes: a slider's
// friction of 3 N slows it by 0.15 mm/s, and it is up to speed in 4 ms.
constexpr Drive kPusherDrive{80.0, 20000.0, 20000.0};

constexpr double kPusherClearance = 0.001;  // m above the surface

constexpr double kWallThickness = 0.02;
constexpr double kFloor = -0.75;  // m, where dropped objects end

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

// Light, colours and sky: pictures only, no influence on motion.
void write_looks(Writer& xml, bool sky) {
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
void write_view(Writer& xml, const Surface& surface, bool hand_in_front) {
  // The cameras were placed for the table of Sec. 3.3.1; a shelf's walls need more room.
  const double walls = surface.kind == Surface::Kind::kShelf ? 0.06 : 0.0;
  const double scale = (std::max(surface.size[0], surface.size[1]) + walls) / 0.6;
  xml.line(
      R"(<light pos="-0.9 -0.1 2.0" dir="0.48 0.16 -1" directional="true" diffuse="0.55 0.55 0.54" specular="0.25 0.25 0.25"/>)");
  if (!hand_in_front) {
    // A surface of 1.0 m x 0.8 m fills the picture.
    const double size = std::max(surface.size[0], surface.size[1] / 0.8) + walls;
    write_camera(xml, "overview", {-0.1 * size, -0.82 * size, 1.16 * size}, {0.01 * size, -0.05 * size, 0.0}, 36);
    write_camera(xml, "top", {0.0, -0.01 * size, 1.3 * size}, {0.0, 0.0, 0.0}, 40);
    return;
  }
  write_camera(xml, "overview", {-0.15 * scale, -0.66 * scale, 1.00 * scale}, {-0.07 * scale, -0.025 * scale, 0.0}, 36);
  write_camera(xml, "top", {-0.1 * scale, -0.01 * scale, 1.2 * scale}, {-0.1 * scale, 0.0, 0.0}, 40);
}

void write_surface(Writer& xml, const Surface& surface) {
  const double half_x = surface.size[0] / 2, half_y = surface.size[1] / 2;
  xml.line(
      R"(<geom name="floor" type="plane" pos="0 0 {}" size="3 3 1" material="floor" contype="{}" conaffinity="0" user="{}"/>)",
      kFloor, kSupport, kFloorMark);
  xml.line(
      R"(<geom name="surface" type="plane" size="{} {} 1" rgba="0 0 0 0" contype="{}" conaffinity="0" user="{}"/>)",
      half_x, half_y, kSupport, kSurfaceMark);
  // What one sees of the table; the plane above is what things stand on.
  xml.line(
      R"(<geom name="table" type="box" pos="0 0 -0.02" size="{} {} 0.0199" material="wood" contype="0" conaffinity="0"/>)",
      half_x, half_y);
  if (surface.kind == Surface::Kind::kTable) return;
  const double half_wall = kWallThickness / 2, half_height = surface.wall_height / 2;
  const auto wall = [&](const char* name, double x, double y, double size_x, double size_y) {
    xml.line(
        R"(<geom name="{}" type="box" pos="{} {} {}" size="{} {} {}" rgba="0.6 0.5 0.4 0.5" contype="{}" conaffinity="0"/>)",
        name, x, y, half_height, size_x, size_y, half_height, kSupport | kWall);
  };
  wall("wall_back", half_x + half_wall, 0, half_wall, half_y + kWallThickness);
  wall("wall_left", 0, half_y + half_wall, half_x, half_wall);
  wall("wall_right", 0, -half_y - half_wall, half_x, half_wall);
}

void write_pusher(Writer& xml, const SceneRobot& robot) {
  xml.line(R"(<body name="pusher" pos="0 0 {}">)", kPusherClearance + robot.height / 2);
  xml.line(R"(<joint name="pusher_x" type="slide" axis="1 0 0" armature="{}"/>)", kPusherDrive.inertia);
  xml.line(R"(<joint name="pusher_y" type="slide" axis="0 1 0" armature="{}"/>)", kPusherDrive.inertia);
  xml.line(
      R"(<geom name="pusher" type="cylinder" size="{} {}" mass="1" material="steel" contype="{}" conaffinity="{}"/>)",
      robot.radius, robot.height / 2, kRobot, kWall);
  xml.line("</body>");
}

void write_gripper(Writer& xml) {
  const auto masks = fmt::format(R"(contype="{}" conaffinity="{}")", kRobot, kWall);
  const auto finger = [&](const char* name, int side) {
    const double y = side * hand::kFingerThickness / 2;
    xml.line(R"(<body name="finger_{}" pos="0 {} {}">)", name, y, hand::kFingerZ - hand::kPalmZ);
    xml.line(R"(<joint name="finger_{}" type="slide" axis="0 {} 0" range="0 {}" limited="true" armature="{}"/>)", name,
             side, hand::kStroke / 2, kFingerDrive.inertia);
    xml.line(R"(<geom name="finger_{}" type="box" pos="{} 0 0" size="{} {} {}" mass="0.1" material="steel" {}/>)", name,
             hand::kFingerLength / 2, hand::kFingerLength / 2, hand::kFingerThickness / 2, hand::kFingerHeight / 2,
             masks);
    xml.line("</body>");
  };
  xml.line(R"(<body name="gripper" pos="0 0 {}">)", hand::kPalmZ);
  xml.line(R"(<joint name="gripper_x" type="slide" axis="1 0 0" armature="{}"/>)", kBaseDrive.inertia);
  xml.line(R"(<joint name="gripper_y" type="slide" axis="0 1 0" armature="{}"/>)", kBaseDrive.inertia);
  xml.line(R"(<joint name="gripper_rotation" type="hinge" axis="0 0 1" armature="{}"/>)", kWristDrive.inertia);
  xml.line(R"(<geom name="palm" type="box" pos="{} 0 0" size="{} {} {}" mass="0.9" material="dark" {}/>)",
           -hand::kPalmDepth / 2, hand::kPalmDepth / 2, hand::kPalmWidth / 2, hand::kPalmHeight / 2, masks);
  xml.line(R"(<geom name="arm" type="box" pos="{} 0 0" size="{} {} {}" mass="0.1" material="arm" {}/>)",
           -hand::kPalmDepth - hand::kArmLength / 2, hand::kArmLength / 2, hand::kArmWidth / 2, hand::kPalmHeight / 2,
           masks);
  finger("left", +1);
  finger("right", -1);
  xml.line("</body>");
}

void write_object(Writer& xml, const SceneObject& object, bool is_target, bool is_free) {
  // Muted, distinct colours for clutter; the target is the green one.
  static constexpr std::array kPalette{"0.75 0.32 0.27 1", "0.30 0.47 0.71 1", "0.85 0.62 0.27 1", "0.54 0.40 0.66 1",
                                       "0.45 0.60 0.65 1"};
  const std::size_t colour = std::hash<std::string>{}(object.name) % kPalette.size();
  const std::string size =
      object.shape == Shape::kBox
          ? fmt::format(R"(type="box" size="{} {} {}")", object.size[0] / 2, object.size[1] / 2, object.size[2] / 2)
          : fmt::format(R"(type="cylinder" size="{} {}")", object.radius, object.height / 2);
  xml.line(R"(<body pos="{} {} {}" quat="{} 0 0 {}" mocap="{}">)", object.x, object.y, object.rest_height(),
           std::cos(object.yaw / 2), std::sin(object.yaw / 2), !is_free);
  if (is_free) xml.line("<freejoint/>");
  // The object's friction is the one that counts against everything softer in
  // priority; between two objects the engine takes the larger one.
  xml.line(
      R"(<geom {} mass="{}" friction="{} 0.005 0.0001" condim="3" priority="1" rgba="{}" contype="{}" conaffinity="{}"/>)",
      size, object.mass, object.friction, is_target ? "0.20 0.65 0.30 1" : kPalette[colour], is_free ? kMovable : 0,
      (is_free ? kSupport : 0) | kMovable | kRobot);
  xml.line("</body>");
}

void write_drive(Writer& xml, const char* joint, const Drive& drive) {
  xml.line(R"(<velocity joint="{}" kv="{}" forcelimited="true" forcerange="{} {}"/>)", joint, drive.gain, -drive.limit,
           drive.limit);
}

}  // namespace

std::string model_xml(const Scene& scene, const ModelContent& content) {
  const int objects = static_cast<int>(scene.objects.size());
  const int free = std::min(content.free, objects);
  // Four points under each object and as many with neighbours; a pyramid cone has
  // four rows per point. Pushed clutter of 6 to 31 objects was measured to have 4.3
  // contacts per object at most. Scratch memory grows with the square of the rows.
  const int contacts = 8 * free + 32;
  Writer xml;
  xml.line(R"(<mujoco model="jostle">)");
  xml.line(R"(<compiler angle="radian" boundmass="0" autolimits="false"/>)");
  xml.line(
      R"(<option timestep="{}" iterations="{}" tolerance="{}" solver="Newton" jacobian="sparse" cone="pyramidal" integrator="{}"/>)",
      scene.physics.time_step, scene.physics.iterations, scene.physics.tolerance,
      scene.physics.integrator == "rk4" ? "RK4" : "Euler");
  xml.line(R"(<size nconmax="{}" njmax="{}" nuser_geom="1"/>)", contacts, 4 * contacts + 8);
  write_looks(xml, content.looks);
  xml.line("<worldbody>");
  write_view(xml, scene.surface, !scene.robot.is_pusher());
  write_surface(xml, scene.surface);
  if (scene.robot.is_pusher()) {
    write_pusher(xml, scene.robot);
  } else {
    write_gripper(xml);
  }
  for (int i = 0; i < objects; ++i) {
    write_object(xml, scene.objects[static_cast<std::size_t>(i)], i == scene.target(), i < free);
  }
  xml.line("</worldbody>");
  xml.line("<actuator>");
  if (scene.robot.is_pusher()) {
    write_drive(xml, "pusher_x", kPusherDrive);
    write_drive(xml, "pusher_y", kPusherDrive);
  } else {
    write_drive(xml, "gripper_x", kBaseDrive);
    write_drive(xml, "gripper_y", kBaseDrive);
    write_drive(xml, "gripper_rotation", kWristDrive);
    write_drive(xml, "finger_left", kFingerDrive);
    write_drive(xml, "finger_right", kFingerDrive);
  }
  xml.line("</actuator>");
  xml.line("</mujoco>");
  return xml.take();
}

}  // namespace jostle::physics_pool
