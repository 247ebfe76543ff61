// Writes message types of the IDL as a ROS 2 package, for the build: jostle_ros_package FOLDER VERSION PACKAGE.

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "idl/files/files.hpp"
#include "services/bags/format/definitions.hpp"

namespace {

using namespace jostle;
namespace fs = std::filesystem;

struct Package {
  std::string name;
  std::vector<std::pair<std::string, std::string>> files;  // name, content
  std::set<std::string> depends;                           // other packages
};

// Returns a type's own file, and notes the packages of the types behind it: a definition has them behind lines of `=`.
std::string own_definition(const std::string& type, Package& package) {
  std::string definition = bags::definition_of(type).value();
  std::istringstream lines(definition);
  for (std::string line; std::getline(lines, line);) {
    constexpr std::string_view kPart = "MSG: ";
    if (!line.starts_with(kPart)) continue;
    const std::string other = line.substr(kPart.size(), line.find('/') - kPart.size());
    if (other != package.name) package.depends.insert(other);
  }
  definition.resize(std::min(definition.find(std::string(80, '=')), definition.size()));
  return definition;
}

// Files that have several definitions, one after the other, by the ends of their types' names. What else there is of a
// service or an action follows from them.
struct Kind {
  std::string_view name;
  std::vector<std::string> parts;
};
const Kind kKinds[] = {
    {"msg", {""}}, {"srv", {"_Request", "_Response"}}, {"action", {"_Goal", "_Result", "_Feedback"}}};

Package read_types(const std::string& name) {
  Package package{.name = name, .files = {}, .depends = {}};
  for (const Kind& kind : kKinds) {
    const std::string prefix = fmt::format("{}/{}/", name, kind.name);
    for (const std::string& type : bags::known_types()) {
      if (!type.starts_with(prefix) || !type.ends_with(kind.parts.front())) continue;
      const std::string stem = type.substr(0, type.size() - kind.parts.front().size());
      // A request of an action's service is none of its own.
      const auto is_there = [&](const std::string& part) { return bags::definition_of(stem + part).has_value(); };
      if (!std::ranges::all_of(kind.parts, is_there)) continue;
      std::string text;
      for (const std::string& part : kind.parts)
        text += (text.empty() ? "" : "---\n") + own_definition(stem + part, package);
      package.files.emplace_back(fmt::format("{0}/{1}.{0}", kind.name, stem.substr(prefix.size())), std::move(text));
      if (kind.name == "action") package.depends.insert("action_msgs");
    }
  }
  return package;
}

std::string manifest(const Package& package, const std::string& version) {
  std::string depends;
  for (const std::string& other : package.depends) depends += fmt::format("  <depend>{}</depend>\n", other);
  return fmt::format(R"(<?xml version="1.0"?>
<package format="3">
  <name>{}</name>
  <version>{}</version>
  <description>Messages as Jostle's IDL has them.</description>
  <maintainer email="jostle@localhost">The Jostle authors</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
{}  <exec_depend>rosidl_default_runtime</exec_depend>
  <member_of_group>rosidl_interface_packages</member_of_group>
  <export>
    <build_type>ament_cmake</build_type>
  </export>
</package>
)",
                     package.name, version, depends);
}

std::string build_file(const Package& package) {
  std::string found, messages, depends;
  if (!package.depends.empty()) depends = "  DEPENDENCIES";
  for (const std::string& other : package.depends) {
    found += fmt::format("find_package({} REQUIRED)\n", other);
    depends += " " + other;
  }
  for (const auto& [file, text] : package.files) messages += fmt::format("  {}\n", file);
  return fmt::format(R"(cmake_minimum_required(VERSION 3.8)
project({})

find_package(ament_cmake REQUIRED)
find_package(rosidl_default_generators REQUIRED)
{}
rosidl_generate_interfaces(${{PROJECT_NAME}}
{}{})
ament_export_dependencies(rosidl_default_runtime)
ament_package()
)",
                     package.name, found, messages, depends);
}

Result<void> write(const fs::path& folder, const std::string& version, const std::string& name) {
  Package package = read_types(name);
  if (package.files.empty()) return invalid("PACKAGE", name, "one that idl/msg has");
  const std::string build = build_file(package);
  package.files.emplace_back("CMakeLists.txt", build);
  package.files.emplace_back("package.xml", manifest(package, version));
  for (const auto& [file, text] : package.files) {
    std::error_code problem;
    fs::create_directories((folder / file).parent_path(), problem);
    if (problem) return Error{Code::kIo, fmt::format("{}: {}", folder.string(), problem.message())};
    if (auto ok = files::write(folder / file, text); !ok) return ok;
  }
  return {};
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return 2;
  const auto ok = write(argv[1], argv[2], argv[3]);
  if (!ok) fmt::print(stderr, "jostle_ros_package: {}\n", ok.error().message);
  return ok ? 0 : 1;
}
