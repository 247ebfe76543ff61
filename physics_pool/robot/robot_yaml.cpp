#include "physics_pool/robot/robot_yaml.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdlib>
#include <iterator>
#include <span>
#include <sstream>
#include <system_error>

#include "idl/files/files.hpp"
#include "idl/text/nearest.hpp"
#include "idl/text/yaml_fields.hpp"
#include "physics_pool/robot/pose_text.hpp"

namespace jostle::embedded {
extern const std::span<const std::pair<std::string_view, std::string_view>> kRobots;
}

namespace jostle::physics_pool {
namespace {

namespace fs = std::filesystem;
using yaml::Fields;
using yaml::quoted;

constexpr std::initializer_list<std::pair<const char*, JointKind>> kJointKinds{{"hinge", JointKind::kHinge},
                                                                               {"slide", JointKind::kSlide}};
constexpr std::initializer_list<std::pair<const char*, GeomShape>> kShapes{{"box", GeomShape::kBox},
                                                                           {"cylinder", GeomShape::kCylinder},
                                                                           {"sphere", GeomShape::kSphere},
                                                                           {"mesh", GeomShape::kMesh}};

std::string_view stem_of(std::string_view file) { return file.substr(0, file.find('.')); }

std::vector<std::string> builtin_robots() {
  std::vector<std::string> names;
  for (const auto& [file, text] : embedded::kRobots) names.emplace_back(stem_of(file));
  return names;
}

template <class E>
const char* word_of(std::initializer_list<std::pair<const char*, E>> words, E value) {
  for (const auto& [word, meaning] : words) {
    if (meaning == value) return word;
  }
  return "?";
}

void read_pose(Fields& fields, Pose& pose) {
  fields.section("pose", false, [&](Fields& in) {
    in.numbers("position", pose.position, false);
    in.numbers("orientation", pose.orientation, false);
  });
}

// Index of a name in a list of named things; complains in the words of the file.
template <class T>
int index_of(const std::vector<T>& things, const std::string& name, const Fields& fields, const char* key) {
  std::vector<std::string> known;
  for (std::size_t i = 0; i < things.size(); ++i) {
    if (things[i].name == name) return static_cast<int>(i);
    known.push_back(things[i].name);
  }
  fields.refuse(key,
                fmt::format("got '{}', wanted one of: {}{}", name, fmt::join(known, ", "), did_you_mean(name, known)));
}

Joint read_joint(Fields& in) {
  Joint joint;
  in.required("name", joint.name);
  in.choice<JointKind>("kind", joint.kind, kJointKinds);
  in.numbers("axis", joint.axis, false);
  std::array<double, 2> range{joint.low, joint.high};
  in.numbers("range", range, false);
  joint.low = range[0];
  joint.high = range[1];
  in.optional("armature", joint.armature);
  in.optional("gain", joint.gain);
  in.optional("force_limit", joint.force_limit);
  in.optional("start", joint.start);
  return joint;
}

RobotGeom read_geom(Fields& in) {
  RobotGeom geom;
  in.optional("name", geom.name);
  const bool has_shape = in.choice<GeomShape>("shape", geom.shape, kShapes);
  if (!has_shape) {
    in.skip({"size", "radius", "height", "vertices", "pose", "mass", "material"});
    return geom;
  }
  if (geom.shape == GeomShape::kBox) in.numbers("size", geom.size, true);
  if (geom.shape == GeomShape::kCylinder || geom.shape == GeomShape::kSphere) in.required("radius", geom.radius);
  if (geom.shape == GeomShape::kCylinder) in.required("height", geom.height);
  if (geom.shape == GeomShape::kMesh) in.required("vertices", geom.vertices);
  read_pose(in, geom.pose);
  in.optional("mass", geom.mass);
  in.optional("material", geom.material);
  return geom;
}

void read_link(Fields& in, RobotModel& model) {
  Link link;
  in.required("name", link.name);
  std::string parent;
  in.optional("parent", parent);
  if (!parent.empty()) link.parent = index_of(model.links, parent, in, "parent");
  read_pose(in, link.pose);
  in.optional_list("joints", [&](Fields& entry) {
    link.joints.push_back(static_cast<int>(model.joints.size()));
    model.joints.push_back(read_joint(entry));
  });
  in.section("inertia", false, [&](Fields& entry) {
    Inertia& inertia = link.inertia.emplace();
    entry.required("mass", inertia.mass);
    read_pose(entry, inertia.pose);
    entry.numbers("moments", inertia.moments, true);
  });
  in.optional_list("geoms", [&](Fields& entry) { link.geoms.push_back(read_geom(entry)); });
  model.links.push_back(std::move(link));
}

void read_axis(Fields& in, RobotModel& model) {
  Axis axis;
  in.required("name", axis.name);
  std::vector<std::pair<std::string, double>> joints;
  in.pairs("joints", joints);
  for (const auto& [name, factor] : joints)
    axis.joints.emplace_back(index_of(model.joints, name, in, "joints"), factor);
  in.optional("limit", axis.limit);
  model.axes.push_back(std::move(axis));
}

void read_hand(Fields& in, RobotModel& model) {
  Hand hand;
  std::string link, left, right, opening;
  in.required("link", link);
  hand.link = index_of(model.links, link, in, "link");
  read_pose(in, hand.pose);
  in.required("near", hand.near);
  in.required("far", hand.far);
  in.required("side", hand.side);
  in.required("depth", hand.depth);
  in.required("finger_length", hand.finger_length);
  in.required("stroke", hand.stroke);
  in.required("left", left);
  in.required("right", right);
  in.required("opening", opening);
  hand.left = index_of(model.joints, left, in, "left");
  hand.right = index_of(model.joints, right, in, "right");
  hand.opening = index_of(model.axes, opening, in, "opening");
  model.hand = hand;
}

// Lines with blanks before them.
class Lines {
 public:
  explicit Lines(int indent) : blanks_(static_cast<std::size_t>(indent), ' ') {}

  template <class... T>
  void line(fmt::format_string<T...> format, T&&... values) {
    text_ += blanks_;
    fmt::format_to(std::back_inserter(text_), format, std::forward<T>(values)...);
    text_ += '\n';
  }
  std::string take() { return std::move(text_); }

 private:
  std::string blanks_, text_;
};

std::string joint_text(const Joint& joint) {
  std::string text = fmt::format("{{name: {}, kind: {}, axis: [{}]", quoted(joint.name),
                                 word_of(kJointKinds, joint.kind), fmt::join(joint.axis, ", "));
  if (joint.is_limited()) text += fmt::format(", range: [{}, {}]", joint.low, joint.high);
  return text + fmt::format(", armature: {}, gain: {}, force_limit: {}, start: {}}}", joint.armature, joint.gain,
                            joint.force_limit, joint.start);
}

std::string geom_text(const RobotGeom& geom) {
  std::string text = fmt::format("{{name: {}, shape: {}", quoted(geom.name), word_of(kShapes, geom.shape));
  if (geom.shape == GeomShape::kBox) text += fmt::format(", size: [{}]", fmt::join(geom.size, ", "));
  if (geom.shape == GeomShape::kCylinder || geom.shape == GeomShape::kSphere)
    text += fmt::format(", radius: {}", geom.radius);
  if (geom.shape == GeomShape::kCylinder) text += fmt::format(", height: {}", geom.height);
  if (geom.shape == GeomShape::kMesh) text += fmt::format(", vertices: [{}]", fmt::join(geom.vertices, ", "));
  return text + fmt::format(", pose: {}, mass: {}, material: {}}}", pose_text(geom.pose), geom.mass, geom.material);
}

Result<RobotModel> parse_robot(std::string_view text, const std::string& origin) {
  return yaml::parse<RobotModel>(text, origin, [&](const YAML::Node& root) -> Result<RobotModel> {
    Fields fields(root, "", origin);
    int version = 0;
    fields.required("jostle_robot", version);
    if (version != 1) fields.refuse("jostle_robot", fmt::format("got version {}, wanted 1", version));
    RobotModel model = read_robot(fields);
    fields.finish();
    if (auto ok = validate(model); !ok)
      return Error{ok.error().code, fmt::format("{}: {}", origin, ok.error().message)};
    return model;
  });
}

Result<RobotModel> load_robot(const fs::path& file, const RobotPath& path) {
  auto text_result = files::read(file, files::kMostText);
  if (!text_result) return text_result.error();
  if (file.extension() == ".urdf" || file.extension() == ".xacro") return parse_urdf(*text_result, file.string(), path);
  return parse_robot(*text_result, file.string());
}

void add_folders(RobotPath& path, const char* variable, const char* below) {
  const char* value = std::getenv(variable);
  std::istringstream folders(value ? value : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (!folder.empty()) path.folders.push_back(fs::path(folder) / below);
  }
}

}  // namespace

RobotModel read_robot(Fields& fields) {
  RobotModel model;
  fields.required("name", model.name);
  fields.optional("carries_itself", model.carries_itself);
  fields.list("links", [&](Fields& entry) { read_link(entry, model); });
  if (!fields.is_sound()) {  // the rest names joints and links, some of which are missing now
    fields.skip({"axes", "hand"});
    return model;
  }
  fields.list("axes", [&](Fields& entry) { read_axis(entry, model); });
  fields.section("hand", false, [&](Fields& entry) { read_hand(entry, model); });
  return model;
}

std::string robot_text(const RobotModel& model, int indent) {
  Lines out(indent);
  out.line("name: {}", quoted(model.name));
  out.line("carries_itself: {}", model.carries_itself);
  out.line("links:");
  for (const Link& link : model.links) {
    out.line("  - name: {}", quoted(link.name));
    if (link.parent >= 0) out.line("    parent: {}", quoted(model.links[static_cast<std::size_t>(link.parent)].name));
    out.line("    pose: {}", pose_text(link.pose));
    if (!link.joints.empty()) out.line("    joints:");
    for (const int joint : link.joints)
      out.line("      - {}", joint_text(model.joints[static_cast<std::size_t>(joint)]));
    if (link.inertia) {
      out.line("    inertia: {{mass: {}, pose: {}, moments: [{}]}}", link.inertia->mass, pose_text(link.inertia->pose),
               fmt::join(link.inertia->moments, ", "));
    }
    if (!link.geoms.empty()) out.line("    geoms:");
    for (const RobotGeom& geom : link.geoms) out.line("      - {}", geom_text(geom));
  }
  out.line("axes:");
  for (const Axis& axis : model.axes) {
    std::vector<std::string> joints;
    for (const auto& [joint, factor] : axis.joints) {
      joints.push_back(fmt::format("{}: {}", quoted(model.joints[static_cast<std::size_t>(joint)].name), factor));
    }
    out.line("  - {{name: {}, joints: {{{}}}, limit: {}}}", quoted(axis.name), fmt::join(joints, ", "), axis.limit);
  }
  if (model.hand) {
    const Hand& hand = *model.hand;
    const auto joint = [&](int i) { return quoted(model.joints[static_cast<std::size_t>(i)].name); };
    out.line("hand:");
    out.line("  link: {}", quoted(model.links[static_cast<std::size_t>(hand.link)].name));
    out.line("  pose: {}", pose_text(hand.pose));
    out.line("  near: {}", hand.near);
    out.line("  far: {}", hand.far);
    out.line("  side: {}", hand.side);
    out.line("  depth: {}", hand.depth);
    out.line("  finger_length: {}", hand.finger_length);
    out.line("  stroke: {}", hand.stroke);
    out.line("  left: {}", joint(hand.left));
    out.line("  right: {}", joint(hand.right));
    out.line("  opening: {}", quoted(model.axes[static_cast<std::size_t>(hand.opening)].name));
  }
  return out.take();
}

Result<RobotModel> builtin_robot(std::string_view name) {
  for (const auto& [file, text] : embedded::kRobots) {
    if (stem_of(file) == name) return parse_robot(text, fmt::format("models/{}", file));
  }
  return Error{Code::kNotFound, fmt::format("got '{}', wanted {}, or a file{}", name, fmt::join(builtin_robots(), ", "),
                                            did_you_mean(name, builtin_robots()))};
}

RobotPath robot_path(const fs::path& base) {
  RobotPath path{.base = base.empty() ? "." : base};
  add_folders(path, "JOSTLE_MODELS", "");
  add_folders(path, "ROS_PACKAGE_PATH", "");
  add_folders(path, "AMENT_PREFIX_PATH", "share");
  return path;
}

Result<RobotModel> find_robot(const std::string& name, const RobotPath& path) {
  if (auto model_result = builtin_robot(name); model_result || model_result.error().code != Code::kNotFound)
    return model_result;
  std::vector<fs::path> folders;
  if (!path.base.empty()) folders.push_back(path.base);
  folders.insert(folders.end(), path.folders.begin(), path.folders.end());
  if (folders.empty()) return builtin_robot(name);  // of text alone: names there are no files
  std::vector<std::string> tried;
  for (const fs::path& folder : folders) {
    for (const char* ending : {"", ".yaml", ".urdf", "/robot.yaml"}) {
      const fs::path file = folder / (name + ending);
      std::error_code ignored;  // a name that no file can have is a name of no file
      if (fs::is_regular_file(file, ignored)) return load_robot(file, path);
    }
    tried.push_back(folder.string());
  }
  return Error{
      Code::kNotFound,
      fmt::format("got '{}', wanted {}, or a file of that name (also with .yaml, .urdf or /robot.yaml) in: {}; "
                  "JOSTLE_MODELS adds folders{}",
                  name, fmt::join(builtin_robots(), ", "), fmt::join(tried, ", "),
                  did_you_mean(name, builtin_robots()))};
}

}  // namespace jostle::physics_pool
