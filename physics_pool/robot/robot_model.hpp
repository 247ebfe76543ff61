#pragma once
/// \file
/// Robots as data: links, joints, drives, and which joints a control moves. Engine-free.

#include <array>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/pose.hpp"
#include "idl/types/result.hpp"

namespace jostle::physics_pool {

enum class JointKind { kSlide, kHinge };

/// One degree of freedom of a link, about or along an axis of the link's own frame. A joint that is driven
/// by velocity makes the force gain·(u - v), limited.
struct Joint {
  std::string name;
  JointKind kind = JointKind::kHinge;
  std::array<double, 3> axis{0, 0, 1};  ///< unit vector
  double low = -std::numeric_limits<double>::infinity(), high = std::numeric_limits<double>::infinity();  ///< m or rad
  double armature = 0.0;     ///< inertia of what drives it, kg or kg m^2
  double gain = 0.0;         ///< N s/m or N m s/rad; 0: nothing drives it
  double force_limit = 0.0;  ///< N or N m
  double start = 0.0;        ///< m or rad, where a scene says nothing

  bool is_limited() const { return high < std::numeric_limits<double>::infinity(); }
  bool operator==(const Joint&) const = default;
};

enum class GeomShape { kBox, kCylinder, kSphere, kMesh };

/// A piece of a link's surface. Cylinders stand along z.
struct RobotGeom {
  std::string name;
  GeomShape shape = GeomShape::kBox;
  std::array<double, 3> size{};       ///< box: full extents x, y, z, m
  double radius = 0.0, height = 0.0;  ///< cylinder and sphere, m
  std::vector<double> vertices;       ///< mesh: [n][3], m; its convex hull is what touches
  Pose pose;                          ///< X_LG, in the link
  double mass = 0.0;                  ///< kg; 0 where the link has its inertia
  std::string material = "steel";     ///< steel, dark or arm: pictures only

  bool operator==(const RobotGeom&) const = default;
};

/// The inertia of a link where it does not follow from the link's geoms.
struct Inertia {
  double mass = 0.0;                ///< kg
  Pose pose;                        ///< centre of mass, and the frame of `moments`
  std::array<double, 6> moments{};  ///< xx, yy, zz, xy, xz, yz, kg m^2

  bool operator==(const Inertia&) const = default;
};

/// A rigid part. It hangs on its parent by its joints, which act one after the other; without any it is fixed.
struct Link {
  std::string name;
  int parent = -1;  ///< an earlier link, or -1: the robot's base
  Pose pose;        ///< X_PL with all joints at 0
  std::vector<int> joints;
  std::optional<Inertia> inertia;
  std::vector<RobotGeom> geoms;

  bool operator==(const Link&) const = default;
};

/// One entry of a control u: the velocity of joint j is `factor`·u for every (j, factor). An opening of two
/// fingers is {left, 1/2}, {right, 1/2}.
struct Axis {
  std::string name;
  std::vector<std::pair<int, double>> joints;
  double limit = 2.0;  ///< largest |u| that any command may ask for, m/s or rad/s

  bool operator==(const Axis&) const = default;
};

/// A hand grasps with two fingers that close along y, in frame G on a link, x forward. An object is in the hand
/// when its centre is in the pre-grasp region.
struct Hand {
  int link = 0;
  Pose pose;                     ///< X_LG
  double near = 0.0, far = 0.0;  ///< m ahead of G, the pre-grasp region
  double side = 0.0;             ///< m either side of its middle
  double depth = 0.0;            ///< m ahead of G, where approaches aim to have the target
  double finger_length = 0.0;    ///< m
  double stroke = 0.0;           ///< m, largest opening
  int left = 0, right = 0;       ///< joints of the fingers; their positions are distances from the middle, m
  int opening = 0;               ///< the axis that moves both

  bool operator==(const Hand&) const = default;
};

struct RobotModel {
  std::string name;
  std::vector<Link> links;    ///< parents before children
  std::vector<Joint> joints;  ///< in the order of q
  std::vector<Axis> axes;     ///< in the order of u
  std::optional<Hand> hand;
  /// Whether the drives carry the robot's own weight, as controllers of arms do.
  bool carries_itself = false;

  bool operator==(const RobotModel&) const = default;

  std::vector<double> start() const;  ///< [joints] m or rad
};

/// A robot that moves in the surface's plane as a whole: its first link slides along x and y, and may turn.
struct PlanarRobot {
  int x = 0, y = 0;   ///< axes of u
  int rotation = -1;  ///< axis of u, or -1: it has no heading
};

/// Says how a robot moves in the plane, if its joints and the axes that move them make it a planar one.
std::optional<PlanarRobot> as_planar(const RobotModel& model);

/// Returns the radius, m, of a planar robot that is nothing but an upright cylinder; nothing for other robots.
std::optional<double> disc_radius(const RobotModel& model);

/// Returns Axis::limit of every axis, in the order of u.
std::vector<double> axis_limits(const RobotModel& model);

/// Checks that names are unique, indices in range, parents before children, axes of length 1, masses and sizes
/// sensible, inertias those of bodies, meshes not flat, and driven joints stable with steps of 2 ms: gain·0.002 at most
/// half the armature. Error kInvalidArgument: "robot.joints[2] ('elbow').gain: got …, wanted …".
Result<void> validate(const RobotModel& model);

}  // namespace jostle::physics_pool
