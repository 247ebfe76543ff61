// Robots from URDF files.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tinyxml2.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <cmath>
#include <map>
#include <numbers>

#include "physics_pool/robot/mesh.hpp"
#include "physics_pool/robot/robot_yaml.hpp"

namespace jostle::physics_pool {
namespace {

namespace fs = std::filesystem;

// A drive's inertia follows from its strength: at full effort it gains so much speed per second. Its gain makes
// it reach a speed in 10 ms, which is stable with steps of 2 ms.
constexpr double kAcceleration = 150.0;    // rad/s^2 or m/s^2
constexpr double kLeastArmature = 0.05;    // kg m^2 or kg
constexpr double kGainOfArmature = 100.0;  // 1/s
constexpr double kFastestJoint = 100.0;    // rad/s or m/s, where a file gives no sensible limit

Pose from_urdf(const urdf::Pose& pose) {
  return {.position = {pose.position.x, pose.position.y, pose.position.z},
          .orientation = {pose.rotation.w, pose.rotation.x, pose.rotation.y, pose.rotation.z}};
}

// Reads one file; every complaint is thrown as yaml::Malformed with file and line.
class Reader {
 public:
  Reader(const std::string& xml, const std::string& origin, const RobotPath& path) : origin_(origin), path_(path) {
    tinyxml2::XMLDocument document;
    if (document.Parse(xml.data(), xml.size()) != tinyxml2::XML_SUCCESS) {
      throw yaml::Malformed{fmt::format("{}:{}: not XML: {}", origin, document.ErrorLineNum(), document.ErrorStr())};
    }
    const tinyxml2::XMLElement* robot = document.FirstChildElement("robot");
    if (!robot)
      throw yaml::Malformed{origin + ":1: got no <robot>, wanted a URDF file; remedy: run xacro on .xacro files"};
    for (const auto* e = robot->FirstChildElement(); e; e = e->NextSiblingElement()) {
      if (const char* name = e->Attribute("name")) lines_[{e->Name(), name}] = e->GetLineNum();
    }
    urdf_ = urdf::parseURDF(xml);
    if (!urdf_) {
      throw yaml::Malformed{origin +
                            ": the URDF parser refused it (its words are above); wanted links and joints that "
                            "make one tree"};
    }
  }

  RobotModel read() {
    model_.name = urdf_->getName();
    model_.carries_itself = true;
    add_link(*urdf_->getRoot(), -1, nullptr);
    add_mimics();
    return std::move(model_);
  }

 private:
  [[noreturn]] void refuse(const char* element, const std::string& name, const std::string& problem) const {
    const auto line = lines_.find({element, name});
    throw yaml::Malformed{fmt::format("{}:{}: <{} name=\"{}\">: {}", origin_, line == lines_.end() ? 1 : line->second,
                                      element, name, problem)};
  }

  void add_link(const urdf::Link& from, int parent, const urdf::Joint* by) {
    Link link{.name = from.name, .parent = parent};
    if (by) {
      link.pose = from_urdf(by->parent_to_joint_origin_transform);
      add_joint(*by, link);
    }
    if (from.inertial) {
      const urdf::Inertial& inertial = *from.inertial;
      link.inertia =
          Inertia{.mass = inertial.mass,
                  .pose = from_urdf(inertial.origin),
                  .moments = {inertial.ixx, inertial.iyy, inertial.izz, inertial.ixy, inertial.ixz, inertial.iyz}};
      if (!(inertial.mass > 0)) link.inertia.reset();
    }
    if (!link.joints.empty() && !link.inertia) {
      refuse("link", from.name, "it moves and has no <inertial> with a mass above 0; remedy: add one");
    }
    for (const auto& collision : from.collision_array) add_geom(from, *collision, link);
    const int index = static_cast<int>(model_.links.size());
    model_.links.push_back(std::move(link));
    for (const auto& joint : from.child_joints) {
      add_link(*urdf_->getLink(joint->child_link_name), index, joint.get());
    }
  }

  void add_joint(const urdf::Joint& from, Link& link) {
    Joint joint{.name = from.name, .axis = {from.axis.x, from.axis.y, from.axis.z}};
    switch (from.type) {
      case urdf::Joint::FIXED:
        return;
      case urdf::Joint::REVOLUTE:
      case urdf::Joint::CONTINUOUS:
        joint.kind = JointKind::kHinge;
        break;
      case urdf::Joint::PRISMATIC:
        joint.kind = JointKind::kSlide;
        break;
      default:
        refuse(
            "joint", from.name,
            "its type is not supported, wanted revolute, continuous, prismatic or fixed; remedy: write a planar joint "
            "as two prismatic and a continuous one, and place a floating robot by robot.base of the scene");
    }
    const double length = std::hypot(from.axis.x, from.axis.y, from.axis.z);
    if (!(length > 0)) refuse("joint", from.name, "<axis>: got length 0, wanted a direction");
    for (double& component : joint.axis) component /= length;
    double effort = 0.0, velocity = 0.0;
    if (from.limits) {
      effort = from.limits->effort;
      velocity = from.limits->velocity;
      if (from.type != urdf::Joint::CONTINUOUS) {
        joint.low = from.limits->lower;
        joint.high = from.limits->upper;
        if (!(joint.low <= joint.high)) {
          refuse("joint", from.name, fmt::format("<limit>: got lower {} above upper {}", joint.low, joint.high));
        }
      }
    }
    if (!(effort > 0))
      refuse("joint", from.name, fmt::format("<limit effort>: got {}, wanted more than 0 N or N m", effort));
    joint.armature = std::max(kLeastArmature, effort / kAcceleration);
    joint.gain = kGainOfArmature * joint.armature;
    joint.force_limit = effort;
    joint.start = std::clamp(0.0, joint.low, joint.high);
    const int index = static_cast<int>(model_.joints.size());
    link.joints.push_back(index);
    model_.joints.push_back(joint);
    if (from.mimic) {
      mimics_.push_back({index, *from.mimic});
      return;
    }
    if (!(velocity > 0)) {
      refuse("joint", from.name, fmt::format("<limit velocity>: got {}, wanted more than 0 rad/s or m/s", velocity));
    }
    model_.axes.push_back({.name = from.name, .joints = {{index, 1.0}}, .limit = std::min(velocity, kFastestJoint)});
  }

  void add_mimics() {
    for (const auto& [follower, mimic] : mimics_) {
      Joint& joint = model_.joints[static_cast<std::size_t>(follower)];
      const auto axis = std::ranges::find(model_.axes, mimic.joint_name, &Axis::name);
      if (axis == model_.axes.end()) {
        refuse("joint", joint.name,
               fmt::format("<mimic joint>: got '{}', wanted a joint that moves by itself", mimic.joint_name));
      }
      axis->joints.emplace_back(follower, mimic.multiplier);
      const Joint& leader = model_.joints[static_cast<std::size_t>(axis->joints[0].first)];
      joint.start = std::clamp(mimic.multiplier * leader.start + mimic.offset, joint.low, joint.high);
    }
  }

  void add_geom(const urdf::Link& from, const urdf::Collision& collision, Link& link) {
    if (!collision.geometry) return;
    RobotGeom geom{.name = fmt::format("{}_{}", from.name, link.geoms.size()),
                   .pose = from_urdf(collision.origin),
                   .material = "arm"};
    switch (collision.geometry->type) {
      case urdf::Geometry::BOX: {
        const urdf::Vector3& size = static_cast<const urdf::Box&>(*collision.geometry).dim;
        geom.shape = GeomShape::kBox;
        geom.size = {size.x, size.y, size.z};
        break;
      }
      case urdf::Geometry::CYLINDER: {
        const auto& cylinder = static_cast<const urdf::Cylinder&>(*collision.geometry);
        geom.shape = GeomShape::kCylinder;
        geom.radius = cylinder.radius;
        geom.height = cylinder.length;
        break;
      }
      case urdf::Geometry::SPHERE:
        geom.shape = GeomShape::kSphere;
        geom.radius = static_cast<const urdf::Sphere&>(*collision.geometry).radius;
        break;
      case urdf::Geometry::MESH:
        read_mesh(from, static_cast<const urdf::Mesh&>(*collision.geometry), geom);
        break;
    }
    link.geoms.push_back(std::move(geom));
  }

  void read_mesh(const urdf::Link& from, const urdf::Mesh& mesh, RobotGeom& geom) {
    geom.shape = GeomShape::kMesh;
    auto vertices_result = mesh_vertices(find_mesh(from, mesh.filename));
    if (!vertices_result) refuse("link", from.name, "<mesh>: " + vertices_result.error().message);
    geom.vertices = std::move(vertices_result).value();
    const std::array<double, 3> scale{mesh.scale.x, mesh.scale.y, mesh.scale.z};
    for (std::size_t i = 0; i < geom.vertices.size(); ++i) geom.vertices[i] *= scale[i % 3];
  }

  fs::path find_mesh(const urdf::Link& from, const std::string& name) const {
    constexpr std::string_view kPackage = "package://", kFile = "file://";
    std::vector<fs::path> candidates;
    if (name.starts_with(kPackage)) {
      const fs::path rest = name.substr(kPackage.size());
      for (const fs::path& folder : path_.folders) candidates.push_back(folder / rest);
      // A package that is no folder of the search path, but around this file.
      for (fs::path folder = fs::path(origin_).parent_path(); !folder.empty() && folder != folder.parent_path();
           folder = folder.parent_path()) {
        candidates.push_back(folder.parent_path() / rest);
      }
    } else if (name.starts_with(kFile)) {
      candidates.emplace_back(name.substr(kFile.size()));
    } else {
      candidates.push_back(fs::path(origin_).parent_path() / name);
    }
    for (const fs::path& candidate : candidates) {
      if (fs::is_regular_file(candidate)) return candidate;
    }
    std::vector<std::string> tried;
    for (const fs::path& candidate : candidates) tried.push_back(candidate.string());
    refuse("link", from.name,
           fmt::format(
               "<mesh filename=\"{}\">: no such file; looked for {}; JOSTLE_MODELS or ROS_PACKAGE_PATH add folders",
               name, fmt::join(tried, ", ")));
  }

  const std::string& origin_;
  const RobotPath& path_;
  std::map<std::pair<std::string, std::string>, int> lines_;  // by element and name
  urdf::ModelInterfaceSharedPtr urdf_;
  RobotModel model_;
  std::vector<std::pair<int, urdf::JointMimic>> mimics_;
};

}  // namespace

Result<RobotModel> parse_urdf(const std::string& xml, const std::string& origin, const RobotPath& path) {
  try {
    RobotModel model = Reader(xml, origin, path).read();
    if (auto ok = validate(model); !ok)
      return Error{ok.error().code, fmt::format("{}: {}", origin, ok.error().message)};
    return model;
  } catch (const yaml::Malformed& malformed) {
    return Error{Code::kInvalidArgument, malformed.message};
  }
}

}  // namespace jostle::physics_pool
