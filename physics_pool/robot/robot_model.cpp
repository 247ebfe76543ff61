#include "physics_pool/robot/robot_model.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <set>

namespace jostle::physics_pool {
namespace {

constexpr double kDriveRatio = 0.5;  // gain·h/armature: explicit drives overshoot above 1, diverge above 2
constexpr double kStep = 0.002;      // s
constexpr double kMostMass = 1000;   // kg, of a link or a geom
constexpr const char* kWantedPose = "finite ones and a unit quaternion";

bool is_axis(const Joint& joint, JointKind kind, const std::array<double, 3>& axis) {
  return joint.kind == kind && joint.axis == axis;
}

// The axis that moves joint j alone and one to one, or -1.
int axis_of(const RobotModel& model, int joint) {
  for (std::size_t i = 0; i < model.axes.size(); ++i) {
    const Axis& axis = model.axes[i];
    if (axis.joints.size() == 1 && axis.joints[0] == std::pair(joint, 1.0)) return static_cast<int>(i);
  }
  return -1;
}

bool is_unit(const std::array<double, 3>& v) { return std::abs(v[0] * v[0] + v[1] * v[1] + v[2] * v[2] - 1) < 1e-6; }
bool is_unit(const std::array<double, 4>& q) {
  return std::abs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1) < 1e-6;
}
bool all_finite(std::span<const double> values) {
  return std::ranges::all_of(values, [](double value) { return std::isfinite(value); });
}
bool is_finite(const Pose& pose) { return all_finite(pose.position) && is_unit(pose.orientation); }

// m; how thin points are that all but lie in a plane, across the direction in which they spread least.
double thickness(std::span<const double> vertices) {
  const Eigen::Map<const Eigen::Matrix3Xd> points(vertices.data(), 3, static_cast<Eigen::Index>(vertices.size() / 3));
  const Eigen::Matrix3Xd spread = points.colwise() - points.rowwise().mean();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(spread * spread.transpose());
  const Eigen::RowVectorXd across = solver.eigenvectors().col(0).transpose() * spread;
  return across.maxCoeff() - across.minCoeff();
}

Error wrong(const std::string& field, double got, const std::string& wanted) {
  return invalid(field, fmt::format("{}", got), wanted);
}

Result<void> check_joint(const std::string& at, const Joint& joint) {
  if (joint.name.empty()) return invalid(at + ".name", "''", "a name");
  if (!is_unit(joint.axis)) {
    return invalid(at + ".axis", fmt::format("[{}, {}, {}]", joint.axis[0], joint.axis[1], joint.axis[2]),
                   "a vector of length 1");
  }
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  const bool is_free = joint.low == -kInfinity && joint.high == kInfinity;
  if (!is_free && !(joint.low < joint.high && std::isfinite(joint.low) && std::isfinite(joint.high))) {
    return invalid(
        at + ".range", fmt::format("[{}, {}]", joint.low, joint.high),
        "two finite numbers, the lower first; remedy: leave it out where nothing limits the joint, and the joint "
        "where it does not move");
  }
  if (!(joint.armature >= 0 && joint.armature <= 1e6)) return wrong(at + ".armature", joint.armature, "0 to 1e6");
  if (!(joint.gain >= 0 && joint.gain * kStep <= kDriveRatio * std::max(joint.armature, 1e-9))) {
    return wrong(
        at + ".gain", joint.gain,
        fmt::format("0 to {:g}, {} times the armature of {} over {} s: above it the drive overshoots; raise the "
                    "armature",
                    kDriveRatio * joint.armature / kStep, kDriveRatio, joint.armature, kStep));
  }
  const bool has_force = joint.gain > 0 ? joint.force_limit > 0 : joint.force_limit >= 0;
  if (!has_force || !std::isfinite(joint.force_limit)) {
    return wrong(at + ".force_limit", joint.force_limit, "a finite number more than 0");
  }
  if (!(joint.start >= joint.low && joint.start <= joint.high && std::isfinite(joint.start))) {
    return wrong(at + ".start", joint.start, fmt::format("{} to {}", joint.low, joint.high));
  }
  return {};
}

// What the engine asks of every inertia: positive principal moments, none above the sum of the others.
Result<void> check_inertia(const std::string& at, const Inertia& inertia) {
  if (!(inertia.mass > 0 && inertia.mass <= kMostMass)) {
    return wrong(at + ".mass", inertia.mass, fmt::format("more than 0, and at most {} kg", kMostMass));
  }
  if (!is_finite(inertia.pose)) return invalid(at + ".pose", "numbers that are no pose", kWantedPose);
  const auto& [xx, yy, zz, xy, xz, yz] = inertia.moments;
  Eigen::Matrix3d moments;
  moments << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  Eigen::Vector3d principal = Eigen::Vector3d::Zero();  // ascending
  if (all_finite(inertia.moments)) principal = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(moments).eigenvalues();
  // A plate has C = A + B, and rounding on either side of it.
  if (principal[0] > 0 && principal[2] <= (principal[0] + principal[1]) * (1 + 1e-6)) return {};
  return invalid(
      at + ".moments", fmt::format("[{}]", fmt::join(inertia.moments, ", ")),
      "moments of a body: the principal ones above 0, and none above the sum of the other two; remedy: those of "
      "a solid cylinder of that size");
}

Result<void> check_geom(const std::string& at, const RobotGeom& geom) {
  constexpr double kLeast = 1e-4, kMost = 10.0;  // m
  const auto size = [&](const char* field, double value) -> Result<void> {
    if (value >= kLeast && value <= kMost) return {};
    return wrong(at + field, value, fmt::format("{} to {} m", kLeast, kMost));
  };
  if (geom.shape == GeomShape::kBox) {
    for (std::size_t i = 0; i < 3; ++i) {
      if (auto ok = size(".size", geom.size[i]); !ok) return ok;
    }
  }
  if (geom.shape == GeomShape::kCylinder || geom.shape == GeomShape::kSphere) {
    if (auto ok = size(".radius", geom.radius); !ok) return ok;
  }
  if (geom.shape == GeomShape::kCylinder) {
    if (auto ok = size(".height", geom.height); !ok) return ok;
  }
  if (geom.shape == GeomShape::kMesh && (geom.vertices.size() < 12 || geom.vertices.size() % 3 != 0)) {
    return invalid(at + ".vertices", fmt::format("{} numbers", geom.vertices.size()),
                   "three for each of 4 points or more");
  }
  if (std::ranges::any_of(geom.vertices, [](double value) { return !(std::abs(value) <= kMost); })) {
    return invalid(at + ".vertices", "a number that is not finite, or too large", fmt::format("-{0} to {0} m", kMost));
  }
  if (geom.shape == GeomShape::kMesh && thickness(geom.vertices) < kLeast) {
    return invalid(at + ".vertices", "points in a plane",
                   fmt::format("a hull {} m thick or more; remedy: a box", kLeast));
  }
  if (!(geom.mass >= 0 && geom.mass <= kMostMass))
    return wrong(at + ".mass", geom.mass, fmt::format("0 to {} kg", kMostMass));
  if (!is_finite(geom.pose)) return invalid(at + ".pose", "numbers that are no pose", kWantedPose);
  static const std::set<std::string> kMaterials{"arm", "dark", "steel"};
  if (!kMaterials.contains(geom.material))
    return invalid(at + ".material", "'" + geom.material + "'", "arm, dark or steel");
  return {};
}

// Whether joints count up from `next` on when one goes from link to link, children first.
bool is_in_order(const RobotModel& model, int parent, int& next) {
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    if (model.links[i].parent != parent) continue;
    for (const int joint : model.links[i].joints) {
      if (joint != next++) return false;
    }
    if (!is_in_order(model, static_cast<int>(i), next)) return false;
  }
  return true;
}

}  // namespace

std::vector<double> RobotModel::start() const {
  std::vector<double> q;
  for (const Joint& joint : joints) q.push_back(joint.start);
  return q;
}

std::optional<PlanarRobot> as_planar(const RobotModel& model) {
  if (model.links.empty() || model.links[0].parent != -1 || model.links[0].joints.size() < 2) return {};
  if (model.links[0].pose.orientation != Pose{}.orientation) return {};  // its axes are not the world's
  const std::vector<int>& joints = model.links[0].joints;
  const auto joint = [&](std::size_t i) -> const Joint& { return model.joints[static_cast<std::size_t>(joints[i])]; };
  if (!is_axis(joint(0), JointKind::kSlide, {1, 0, 0}) || !is_axis(joint(1), JointKind::kSlide, {0, 1, 0})) return {};
  PlanarRobot planar{.x = axis_of(model, joints[0]), .y = axis_of(model, joints[1])};
  if (planar.x < 0 || planar.y < 0) return {};
  if (joints.size() == 2) return planar;
  if (joints.size() > 3 || !is_axis(joint(2), JointKind::kHinge, {0, 0, 1})) return {};
  planar.rotation = axis_of(model, joints[2]);
  return planar.rotation < 0 ? std::nullopt : std::optional(planar);
}

std::optional<double> disc_radius(const RobotModel& model) {
  const auto planar = as_planar(model);
  if (!planar || planar->rotation >= 0 || model.links.size() != 1 || model.links[0].geoms.size() != 1) return {};
  const RobotGeom& geom = model.links[0].geoms[0];
  if (geom.shape != GeomShape::kCylinder || !(geom.pose == Pose{})) return {};
  return geom.radius;
}

std::vector<double> axis_limits(const RobotModel& model) {
  std::vector<double> limits;
  for (const Axis& axis : model.axes) limits.push_back(axis.limit);
  return limits;
}

Result<void> validate(const RobotModel& model) {
  const auto in_range = [](int i, std::size_t size) { return i >= 0 && static_cast<std::size_t>(i) < size; };
  if (model.links.empty()) return invalid("robot.links", "none", "one at least");
  if (model.joints.empty()) return invalid("robot.joints", "none", "one at least");
  if (model.axes.empty()) return invalid("robot.axes", "none", "one at least: nothing else moves a robot");
  constexpr std::size_t kMostJoints = 64;
  if (model.joints.size() > kMostJoints || model.axes.size() > kMostJoints) {
    return invalid("robot.joints", fmt::format("{}", model.joints.size()), fmt::format("at most {}", kMostJoints));
  }
  constexpr std::size_t kMostLinks = 256;  // who follows a chain of links does so by recursion
  if (model.links.size() > kMostLinks) {
    return invalid("robot.links", fmt::format("{}", model.links.size()), fmt::format("at most {}", kMostLinks));
  }
  std::set<std::string> names, geom_names;
  std::vector<int> uses(model.joints.size(), 0);
  for (std::size_t i = 0; i < model.links.size(); ++i) {
    const Link& link = model.links[i];
    const std::string at = fmt::format("robot.links[{}] ('{}')", i, link.name);
    if (link.name.empty() || !names.insert(link.name).second)
      return invalid(at + ".name", "'" + link.name + "'", "a name of its own");
    if (link.parent < -1 || link.parent >= static_cast<int>(i)) {
      return wrong(at + ".parent", link.parent, "an earlier link, or -1");
    }
    if (!is_finite(link.pose)) return invalid(at + ".pose", "numbers that are no pose", kWantedPose);
    if (link.inertia) {
      if (auto ok = check_inertia(at + ".inertia", *link.inertia); !ok) return ok;
    }
    for (const int joint : link.joints) {
      if (!in_range(joint, model.joints.size()))
        return wrong(at + ".joints", joint, fmt::format("0 to {}", model.joints.size() - 1));
      ++uses[static_cast<std::size_t>(joint)];
    }
    for (std::size_t k = 0; k < link.geoms.size(); ++k) {
      const std::string geom_at = fmt::format("{}.geoms[{}]", at, k);
      if (auto ok = check_geom(geom_at, link.geoms[k]); !ok) return ok;
      const std::string& name = link.geoms[k].name;
      if (!name.empty() && !geom_names.insert(name).second)
        return invalid(geom_at + ".name", "'" + name + "'", "a name of its own");
    }
    double mass = link.inertia ? link.inertia->mass : 0.0;
    for (const RobotGeom& geom : link.geoms) mass += geom.mass;
    if (!link.joints.empty() && !(mass > 0)) {
      return wrong(at + ".mass", mass, "more than 0 kg, of its geoms or its inertia: it moves");
    }
  }
  names.clear();
  int next = 0;
  if (!is_in_order(model, -1, next)) {
    return invalid("robot.links", "an order in which joints do not count up from link to link",
                   "each link followed by its children, and theirs");
  }
  for (std::size_t i = 0; i < model.joints.size(); ++i) {
    const std::string at = fmt::format("robot.joints[{}] ('{}')", i, model.joints[i].name);
    if (auto ok = check_joint(at, model.joints[i]); !ok) return ok;
    if (!names.insert(model.joints[i].name).second) return invalid(at + ".name", "a name twice", "a name of its own");
    if (uses[i] != 1) return invalid(at, fmt::format("{} links that use it", uses[i]), "1");
  }
  names.clear();
  for (std::size_t i = 0; i < model.axes.size(); ++i) {
    const Axis& axis = model.axes[i];
    const std::string at = fmt::format("robot.axes[{}] ('{}')", i, axis.name);
    if (axis.name.empty() || !names.insert(axis.name).second)
      return invalid(at + ".name", "'" + axis.name + "'", "a name of its own");
    if (axis.joints.empty()) return invalid(at + ".joints", "none", "one at least");
    if (!(axis.limit > 0 && std::isfinite(axis.limit))) return wrong(at + ".limit", axis.limit, "more than 0");
    std::set<int> moved;
    for (const auto& [joint, factor] : axis.joints) {
      if (!in_range(joint, model.joints.size()))
        return wrong(at + ".joints", joint, fmt::format("0 to {}", model.joints.size() - 1));
      if (!moved.insert(joint).second) return wrong(at + ".joints", joint, "each joint once");
      if (!std::isfinite(factor) || factor == 0)
        return wrong(at + ".joints", factor, "a factor that is finite and not 0");
      if (!(model.joints[static_cast<std::size_t>(joint)].gain > 0)) {
        return invalid(at + ".joints",
                       "'" + model.joints[static_cast<std::size_t>(joint)].name + "', which has no drive",
                       "joints with a gain");
      }
    }
  }
  if (!model.hand) return {};
  const Hand& hand = *model.hand;
  if (!in_range(hand.link, model.links.size())) return wrong("robot.hand.link", hand.link, "a link");
  if (!in_range(hand.left, model.joints.size()) || !in_range(hand.right, model.joints.size())) {
    return invalid("robot.hand.fingers", "a joint that there is not", "two joints");
  }
  if (!in_range(hand.opening, model.axes.size())) return wrong("robot.hand.opening", hand.opening, "an axis");
  if (hand.left == hand.right) return invalid("robot.hand.fingers", "one joint twice", "two joints");
  if (!is_finite(hand.pose)) return invalid("robot.hand.pose", "numbers that are no pose", kWantedPose);
  const std::array<double, 6> measures{hand.near, hand.far, hand.side, hand.depth, hand.finger_length, hand.stroke};
  if (!(std::ranges::all_of(measures, [](double value) { return value < 10; }) && hand.near >= 0 &&
        hand.far > hand.near && hand.side > 0 && hand.depth > 0 && hand.finger_length > 0 && hand.stroke > 0)) {
    return invalid("robot.hand", "measures that do not fit",
                   "0 <= near < far; side, depth, finger_length, stroke > 0; all below 10 m");
  }
  return {};
}

}  // namespace jostle::physics_pool
