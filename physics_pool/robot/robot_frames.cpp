#include "physics_pool/robot/robot_frames.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tinyxml2.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <optional>

#include "physics_pool/robot/joint_motion.hpp"

namespace jostle::physics_pool {
namespace {

constexpr double kFar = 1000.0;                 // m
constexpr double kTurn = 2 * std::numbers::pi;  // rad

// Whether URDF's rule that everything hangs on one link that does not move holds for the first link.
bool has_root(const RobotModel& model) {
  const auto roots = std::ranges::count(model.links, -1, &Link::parent);
  return roots == 1 && model.links[0].joints.empty() && model.links[0].pose == Pose{};
}

std::string numbers(std::span<const double> values) { return fmt::format("{}", fmt::join(values, " ")); }

// Roll, pitch and yaw: turns about x, y and z of the parent, one after the other.
std::array<double, 3> roll_pitch_yaw(const Pose& pose) {
  const Eigen::Matrix3d R = transform(pose).linear();
  const double level = std::hypot(R(0, 0), R(1, 0));
  const double pitch = std::atan2(-R(2, 0), level);
  if (level < 1e-9) return {0.0, pitch, std::atan2(-R(0, 1), R(1, 1))};  // roll and yaw are one turn there
  return {std::atan2(R(2, 1), R(2, 2)), pitch, std::atan2(R(1, 0), R(0, 0))};
}

struct Box {
  std::array<double, 3> middle{}, size{};
};

Box box_around(const std::vector<double>& vertices) {
  std::array<double, 3> low, high;
  low.fill(std::numeric_limits<double>::infinity());
  high.fill(-std::numeric_limits<double>::infinity());
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    low[i % 3] = std::min(low[i % 3], vertices[i]);
    high[i % 3] = std::max(high[i % 3], vertices[i]);
  }
  Box box;
  for (std::size_t k = 0; k < 3; ++k) {
    box.middle[k] = (low[k] + high[k]) / 2;
    box.size[k] = high[k] - low[k];
  }
  return box;
}

// Of a solid whose mass is spread evenly, about its centre: xx, yy, zz.
Eigen::Vector3d moments(const RobotGeom& geom) {
  const double m = geom.mass;
  if (geom.shape == GeomShape::kSphere) return Eigen::Vector3d::Constant(0.4 * m * geom.radius * geom.radius);
  if (geom.shape == GeomShape::kCylinder) {
    const double r2 = geom.radius * geom.radius;
    const double across = m * (3 * r2 + geom.height * geom.height) / 12;
    return {across, across, m * r2 / 2};
  }
  const auto [x, y, z] = geom.shape == GeomShape::kMesh ? box_around(geom.vertices).size : geom.size;
  return Eigen::Vector3d(y * y + z * z, x * x + z * z, x * x + y * y) * (m / 12);
}

// What the link says, or the sum of its geoms; nothing without a mass.
std::optional<Inertia> inertia_of(const Link& link) {
  if (link.inertia) return link.inertia;
  double mass = 0.0;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const RobotGeom& geom : link.geoms) {
    mass += geom.mass;
    centre += geom.mass * transform(geom.pose).translation();
  }
  if (!(mass > 0)) return {};
  centre /= mass;
  Eigen::Matrix3d I = Eigen::Matrix3d::Zero();
  for (const RobotGeom& geom : link.geoms) {
    const Eigen::Isometry3d X = transform(geom.pose);
    const Eigen::Vector3d p = X.translation() - centre;
    I += X.linear() * moments(geom).asDiagonal() * X.linear().transpose();
    I += geom.mass * (p.squaredNorm() * Eigen::Matrix3d::Identity() - p * p.transpose());
  }
  return Inertia{.mass = mass,
                 .pose = {.position = {centre.x(), centre.y(), centre.z()}},
                 .moments = {I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)}};
}

// The speed that a command may ask of a joint, m/s or rad/s; 0: none moves it.
double speed_limit(const RobotModel& model, int joint) {
  double most = 0.0;
  for (const Axis& axis : model.axes) {
    for (const auto& [moved, factor] : axis.joints) {
      if (moved == joint) most = std::max(most, axis.limit * std::abs(factor));
    }
  }
  return most;
}

class Writer {
 public:
  explicit Writer(const RobotModel& model) : model_(model) {}

  std::string write(const std::vector<RobotFrame>& frames) {
    out_.PushHeader(false, true);
    out_.OpenElement("robot");
    out_.PushAttribute("name", model_.name.c_str());
    for (const auto& [name, color] : {std::pair{"steel", "0.55 0.58 0.61 1"}, std::pair{"dark", "0.24 0.25 0.27 1"},
                                      std::pair{"arm", "0.44 0.63 0.81 1"}}) {
      out_.OpenElement("material");
      out_.PushAttribute("name", name);
      element("color", {{"rgba", color}});
      out_.CloseElement();
    }
    for (const RobotFrame& frame : frames) write_link(frame);
    for (const RobotFrame& frame : frames) {
      if (frame.parent >= 0) write_joint(frame, frames[static_cast<std::size_t>(frame.parent)]);
    }
    out_.CloseElement();
    return out_.CStr();
  }

 private:
  using Attributes = std::vector<std::pair<const char*, std::string>>;

  void element(const char* name, const Attributes& attributes) {
    out_.OpenElement(name);
    for (const auto& [key, value] : attributes) out_.PushAttribute(key, value.c_str());
    out_.CloseElement();
  }

  void write_origin(const Pose& pose) {
    element("origin", {{"xyz", numbers(pose.position)}, {"rpy", numbers(roll_pitch_yaw(pose))}});
  }

  void write_link(const RobotFrame& frame) {
    out_.OpenElement("link");
    out_.PushAttribute("name", frame.name.c_str());
    if (frame.link >= 0) {
      const Link& link = model_.links[static_cast<std::size_t>(frame.link)];
      if (const auto inertia = inertia_of(link)) write_inertia(*inertia);
      for (const char* kind : {"visual", "collision"}) {
        for (const RobotGeom& geom : link.geoms) write_geom(kind, geom);
      }
    }
    out_.CloseElement();
  }

  void write_inertia(const Inertia& inertia) {
    out_.OpenElement("inertial");
    write_origin(inertia.pose);
    element("mass", {{"value", fmt::format("{}", inertia.mass)}});
    Attributes moments;
    constexpr const char* kNames[] = {"ixx", "iyy", "izz", "ixy", "ixz", "iyz"};
    for (std::size_t i = 0; i < 6; ++i) moments.emplace_back(kNames[i], fmt::format("{}", inertia.moments[i]));
    element("inertia", moments);
    out_.CloseElement();
  }

  void write_geom(const char* kind, const RobotGeom& geom) {
    out_.OpenElement(kind);
    const bool is_mesh = geom.shape == GeomShape::kMesh;
    const Box box = is_mesh ? box_around(geom.vertices) : Box{.middle = {}, .size = geom.size};
    Pose pose = geom.pose;
    if (is_mesh)
      pose = pose_of(transform(geom.pose) * transform(Pose{.position = box.middle, .orientation = {1, 0, 0, 0}}));
    write_origin(pose);
    out_.OpenElement("geometry");
    const std::string radius = fmt::format("{}", geom.radius);
    if (geom.shape == GeomShape::kSphere) {
      element("sphere", {{"radius", radius}});
    } else if (geom.shape == GeomShape::kCylinder) {
      element("cylinder", {{"radius", radius}, {"length", fmt::format("{}", geom.height)}});
    } else {
      element("box", {{"size", numbers(box.size)}});
    }
    out_.CloseElement();
    if (std::string_view(kind) == "visual") element("material", {{"name", geom.material}});
    out_.CloseElement();
  }

  void write_joint(const RobotFrame& frame, const RobotFrame& parent) {
    const Joint* joint = frame.joint < 0 ? nullptr : &model_.joints[static_cast<std::size_t>(frame.joint)];
    const bool turns = joint && joint->kind == JointKind::kHinge;
    out_.OpenElement("joint");
    out_.PushAttribute("name", joint ? joint->name.c_str() : (frame.name + "_fixed").c_str());
    out_.PushAttribute("type", !joint                ? "fixed"
                               : !turns              ? "prismatic"
                               : joint->is_limited() ? "revolute"
                                                     : "continuous");
    write_origin(frame.pose);
    element("parent", {{"link", parent.name}});
    element("child", {{"link", frame.name}});
    if (joint) {
      element("axis", {{"xyz", numbers(joint->axis)}});
      const double far = turns ? kTurn : kFar;
      element("limit", {{"lower", fmt::format("{}", std::max(joint->low, -far))},
                        {"upper", fmt::format("{}", std::min(joint->high, far))},
                        {"effort", fmt::format("{}", joint->force_limit)},
                        {"velocity", fmt::format("{}", speed_limit(model_, frame.joint))}});
    }
    out_.CloseElement();
  }

  const RobotModel& model_;
  tinyxml2::XMLPrinter out_;
};

}  // namespace

std::vector<RobotFrame> robot_frames(const RobotModel& model, const Pose& base, const std::vector<std::string>& taken) {
  std::vector<RobotFrame> frames;
  const auto is_used = [&](const std::string& name) {
    return std::ranges::count(taken, name) > 0 || std::ranges::count(frames, name, &RobotFrame::name) > 0;
  };
  const auto add = [&](RobotFrame frame) {
    while (is_used(frame.name)) frame.name += '_';
    frames.push_back(std::move(frame));
    return static_cast<int>(frames.size()) - 1;
  };
  const bool first_is_root = has_root(model);
  if (!first_is_root) add({.name = "robot_base", .pose = base});
  std::vector<int> frame_of;  // by link
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const Link& link = model.links[i];
    if (i == 0 && first_is_root) {
      frame_of.push_back(add({.name = link.name, .pose = base, .link = 0}));
      continue;
    }
    int parent = link.parent < 0 ? 0 : frame_of[static_cast<std::size_t>(link.parent)];
    Pose pose = link.pose;
    for (std::size_t j = 0; j + 1 < link.joints.size(); ++j) {
      const std::string& name = model.joints[static_cast<std::size_t>(link.joints[j])].name;
      parent = add({.name = name, .parent = parent, .pose = pose, .joint = link.joints[j]});
      pose = {};
    }
    frame_of.push_back(add({.name = link.name,
                            .parent = parent,
                            .pose = pose,
                            .joint = link.joints.empty() ? -1 : link.joints.back(),
                            .link = static_cast<int>(i)}));
  }
  return frames;
}

Eigen::Isometry3d frame_pose(const RobotModel& model, const RobotFrame& frame, std::span<const double> q) {
  Eigen::Isometry3d X = transform(frame.pose);
  if (frame.joint >= 0) {
    const auto j = static_cast<std::size_t>(frame.joint);
    move(X, model.joints[j], q[j]);
  }
  return X;
}

std::string to_urdf(const RobotModel& model, const std::vector<RobotFrame>& frames) {
  return Writer(model).write(frames);
}

}  // namespace jostle::physics_pool
