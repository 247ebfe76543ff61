// Robots from URDF files.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <tinyxml2.h>
#include <urdf_model/model.h>
#include <urdf_parser/urdf_parser.h>

#include <cmath>
#include <map>
#include <set>
#include <string_view>
#include <system_error>

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

using tinyxml2::XMLElement;

// What of xacro is left in an element or below it; null if nothing is.
const XMLElement* find_xacro(const XMLElement& element) {
  if (std::string_view(element.Name()).starts_with("xacro:")) return &element;
  for (const auto* a = element.FirstAttribute(); a; a = a->Next()) {
    const std::string_view value = a->Value();
    if (value.find("${") != value.npos || value.find("$(") != value.npos) return &element;
  }
  for (const auto* e = element.FirstChildElement(); e; e = e->NextSiblingElement()) {
    if (const XMLElement* found = find_xacro(*e)) return found;
  }
  return nullptr;
}

std::string attribute(const XMLElement* element, const char* name) {
  const char* value = element ? element->Attribute(name) : nullptr;
  return value ? value : "";
}

// Reads one file; every complaint is thrown as an Error with file and line.
class Reader {
 public:
  Reader(const std::string& xml, const std::string& origin, const RobotPath& path) : origin_(origin), path_(path) {
    tinyxml2::XMLDocument document;
    if (document.Parse(xml.data(), xml.size()) != tinyxml2::XML_SUCCESS) {
      refuse_at(document.ErrorLineNum(), fmt::format("not XML: {}", document.ErrorStr()));
    }
    const XMLElement* robot = document.FirstChildElement("robot");
    if (!robot) refuse_at(1, "got no <robot>, wanted a URDF file");
    if (const XMLElement* xacro = find_xacro(*robot)) {
      refuse_at(xacro->GetLineNum(), fmt::format("<{}>: got xacro, wanted plain URDF; remedy: xacro {} > NAME.urdf",
                                                 xacro->Name(), fs::path(origin).filename().string()));
    }
    for (const auto* e = robot->FirstChildElement(); e; e = e->NextSiblingElement()) {
      if (const char* name = e->Attribute("name")) lines_[{e->Name(), name}] = e->GetLineNum();
    }
    for (const auto* link = robot->FirstChildElement("link"); link; link = link->NextSiblingElement("link")) {
      Parts& parts = parts_[attribute(link, "name")];
      parts.has_inertial = link->FirstChildElement("inertial");
      for (const auto* e = link->FirstChildElement("collision"); e; e = e->NextSiblingElement("collision")) {
        ++parts.collisions;
      }
    }
    check_joints(*robot);
    check_root(*robot);
    urdf_ = urdf::parseURDF(xml);
    if (!urdf_)
      refuse_at(1, "the URDF parser refused it, in the words above; wanted what wiki.ros.org/urdf/XML describes");
  }

  RobotModel read() {
    model_.name = urdf_->getName();
    model_.carries_itself = true;
    add_link(*urdf_->getRoot(), -1, nullptr, false);
    add_mimics();
    if (auto ok = validate(model_); !ok) throw located(ok.error());
    return std::move(model_);
  }

 private:
  [[noreturn]] void refuse_at(int line, const std::string& problem, Code code = Code::kInvalidArgument) const {
    throw Error{code, fmt::format("{}:{}: {}", origin_, line, problem)};
  }
  [[noreturn]] void refuse(const char* element, const std::string& name, const std::string& problem,
                           Code code = Code::kInvalidArgument) const {
    refuse_at(line_of(element, name), fmt::format("<{} name=\"{}\">: {}", element, name, problem), code);
  }
  int line_of(const char* element, const std::string& name) const {
    const auto line = lines_.find({element, name});
    return line == lines_.end() ? 1 : line->second;
  }

  // What validate() says, "robot.links[2] ('elbow')…", with the line of the link or joint.
  Error located(const Error& error) const {
    const std::string& message = error.message;
    const std::size_t begin = message.find("('"), end = message.find("')");
    const std::string name = end < message.npos ? message.substr(begin + 2, end - begin - 2) : "";
    const int line = line_of(message.starts_with("robot.links") ? "link" : "joint", name);
    return {error.code, fmt::format("{}:{}: {}", origin_, line, message)};
  }

  // What the parser would refuse without a line.
  void check_joints(const XMLElement& robot) {
    static const std::set<std::string> kTypes{"revolute", "continuous", "prismatic", "fixed"};
    for (const auto* joint = robot.FirstChildElement("joint"); joint; joint = joint->NextSiblingElement("joint")) {
      const std::string name = attribute(joint, "name"), type = attribute(joint, "type");
      if (!kTypes.contains(type)) {
        refuse("joint", name,
               fmt::format(
                   "got type '{}', wanted {}; remedy: write a planar joint as two prismatic and a continuous one, and "
                   "place a floating robot by robot.base of the scene",
                   type, fmt::join(kTypes, ", ")));
      }
      for (const char* end : {"parent", "child"}) {
        const std::string link = attribute(joint->FirstChildElement(end), "link");
        if (!lines_.contains({"link", link})) {
          refuse("joint", name,
                 fmt::format("<{} link>: got '{}', wanted the name of a <link> of this file", end, link));
        }
      }
      const std::string child = attribute(joint->FirstChildElement("child"), "link");
      if (!parents_.try_emplace(child, attribute(joint->FirstChildElement("parent"), "link")).second) {
        refuse("joint", name,
               fmt::format("<child link>: got '{}', which hangs on another joint; wanted each link once", child));
      }
      const XMLElement* limit = joint->FirstChildElement("limit");
      if (!limit && (type == "revolute" || type == "prismatic")) {
        refuse("joint", name, "got no <limit>, wanted one with lower, upper, effort and velocity");
      }
      for (const char* key : {"effort", "velocity"}) {
        if (limit && !limit->Attribute(key)) refuse("joint", name, fmt::format("<limit>: got no {}, wanted one", key));
      }
    }
  }

  void check_root(const XMLElement& robot) const {
    std::string root;
    for (const auto* link = robot.FirstChildElement("link"); link; link = link->NextSiblingElement("link")) {
      const std::string name = attribute(link, "name");
      if (parents_.contains(name)) continue;
      if (!root.empty()) {
        refuse(
            "link", name,
            fmt::format("got two roots, this and '{}', wanted one tree; remedy: hang one on the other by a fixed joint",
                        root));
      }
      root = name;
    }
    if (root.empty()) refuse_at(robot.GetLineNum(), "<robot>: got no root, wanted a <link> that is no joint's child");
    check_circles(root);
  }

  // The parser would leave such links out without a word, and never free them.
  void check_circles(const std::string& root) const {
    for (const auto& [child, parent] : parents_) {
      std::string link = child;
      for (std::size_t steps = 0; link != root; ++steps) {
        if (steps == parents_.size()) {
          refuse("link", child, "got a circle of joints, wanted links that hang on the root '" + root + "'");
        }
        link = parents_.at(link);
      }
    }
  }

  // The parser leaves out what it cannot read of a link, and goes on.
  void check_whole(const urdf::Link& link) const {
    const auto parts = parts_.find(link.name);
    if (parts == parts_.end() || (parts->second.collisions == link.collision_array.size() &&
                                  parts->second.has_inertial == static_cast<bool>(link.inertial))) {
      return;
    }
    refuse(
        "link", link.name,
        "the URDF parser could not read all of its <inertial>, <visual> and <collision>, for the reason above; wanted "
        "what wiki.ros.org/urdf/XML/link describes");
  }

  // `moves`: whether what it hangs on does.
  void add_link(const urdf::Link& from, int parent, const urdf::Joint* by, bool moves) {
    check_whole(from);
    Link link{.name = from.name, .parent = parent};
    if (by) {
      link.pose = from_urdf(by->parent_to_joint_origin_transform);
      add_joint(*by, link);
    }
    moves = moves || !link.joints.empty();
    // The weight of what never moves is nobody's concern, and often made up.
    if (from.inertial && moves) {
      const urdf::Inertial& inertial = *from.inertial;
      link.inertia =
          Inertia{.mass = inertial.mass,
                  .pose = from_urdf(inertial.origin),
                  .moments = {inertial.ixx, inertial.iyy, inertial.izz, inertial.ixy, inertial.ixz, inertial.iyz}};
      if (!(inertial.mass > 0)) link.inertia.reset();
    }
    if (!link.joints.empty() && !link.inertia) {
      refuse("link", from.name, "got no <inertial> with a mass above 0, wanted one: it moves; remedy: add it");
    }
    for (const auto& collision : from.collision_array) add_geom(from, *collision, link);
    const int index = static_cast<int>(model_.links.size());
    model_.links.push_back(std::move(link));
    for (const auto& joint : from.child_joints) {
      add_link(*urdf_->getLink(joint->child_link_name), index, joint.get(), moves);
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
        refuse("joint", from.name, "got a type that is not supported");  // check_joints saw it first
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
        if (!(joint.low < joint.high)) {
          refuse(
              "joint", from.name,
              fmt::format("<limit>: got lower {} and upper {}, wanted lower below upper; remedy: type continuous for a "
                          "joint that turns for ever, fixed for one that does not move",
                          joint.low, joint.high));
        }
      }
    }
    if (!(effort > 0)) {
      refuse("joint", from.name,
             fmt::format("<limit effort>: got {}, wanted more than 0 N or N m; remedy: the strength of its drive",
                         effort));
    }
    joint.armature = std::max(kLeastArmature, effort / kAcceleration);
    joint.gain = kGainOfArmature * joint.armature;
    joint.force_limit = effort;
    joint.start = std::clamp(0.0, joint.low, joint.high);
    const int index = static_cast<int>(model_.joints.size());
    link.joints.push_back(index);
    model_.joints.push_back(joint);
    if (from.mimic) {
      mimics_.emplace_back(index, *from.mimic);
      return;
    }
    if (!(velocity > 0)) {
      refuse("joint", from.name,
             fmt::format("<limit velocity>: got {}, wanted more than 0 rad/s or m/s; remedy: the speed of its drive",
                         velocity));
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
      if (!(std::isfinite(mimic.multiplier) && mimic.multiplier != 0)) {
        refuse("joint", joint.name,
               fmt::format("<mimic multiplier>: got {}, wanted a number that is not 0; remedy: type fixed",
                           mimic.multiplier));
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
    const std::array<double, 3> scale{mesh.scale.x, mesh.scale.y, mesh.scale.z};
    if (!(scale[0] * scale[1] * scale[2] > 0)) {
      refuse("link", from.name,
             fmt::format(
                 "<mesh scale>: got {}, which mirrors the mesh or flattens it, wanted positive factors; remedy: mirror "
                 "the file",
                 fmt::join(scale, " ")));
    }
    auto vertices_result = mesh_vertices(find_mesh(from, mesh.filename));
    if (!vertices_result)
      refuse("link", from.name, "<mesh>: " + vertices_result.error().message, vertices_result.error().code);
    geom.vertices = std::move(vertices_result).value();
    for (std::size_t i = 0; i < geom.vertices.size(); ++i) geom.vertices[i] *= scale[i % 3];
  }

  fs::path find_mesh(const urdf::Link& from, const std::string& name) const {
    constexpr std::string_view kPackage = "package://", kFile = "file://";
    const fs::path here = fs::absolute(origin_).lexically_normal().parent_path();
    std::vector<fs::path> candidates;
    if (name.starts_with(kPackage)) {
      const fs::path rest = name.substr(kPackage.size());
      for (const fs::path& folder : path_.folders) candidates.push_back(folder / rest);
      // A package that is no folder of the search path, but around this file.
      for (fs::path folder = here; folder != folder.parent_path(); folder = folder.parent_path()) {
        candidates.push_back(folder.parent_path() / rest);
      }
    } else if (name.starts_with(kFile)) {
      candidates.emplace_back(name.substr(kFile.size()));
    } else {
      candidates.push_back(here / name);
    }
    for (const fs::path& candidate : candidates) {
      std::error_code ignored;  // a name that no file can have is a name of no file
      if (fs::is_regular_file(candidate, ignored)) return candidate;
    }
    std::vector<std::string> tried;
    tried.reserve(candidates.size());
    for (const fs::path& candidate : candidates) tried.push_back(candidate.string());
    refuse("link", from.name,
           fmt::format(
               "<mesh filename=\"{}\">: no such file; looked for {}; JOSTLE_MODELS or ROS_PACKAGE_PATH add folders",
               name, fmt::join(tried, ", ")),
           Code::kNotFound);
  }

  const std::string& origin_;
  const RobotPath& path_;
  std::map<std::pair<std::string, std::string>, int> lines_;  // by element and name
  struct Parts {
    bool has_inertial = false;
    std::size_t collisions = 0;
  };
  std::map<std::string, Parts> parts_;          // what the file has of a link
  std::map<std::string, std::string> parents_;  // of links that hang on a joint
  urdf::ModelInterfaceSharedPtr urdf_;
  RobotModel model_;
  std::vector<std::pair<int, urdf::JointMimic>> mimics_;
};

}  // namespace

Result<RobotModel> parse_urdf(const std::string& xml, const std::string& origin, const RobotPath& path) {
  try {
    return Reader(xml, origin, path).read();
  } catch (const Error& error) {
    return error;
  }
}

}  // namespace jostle::physics_pool
