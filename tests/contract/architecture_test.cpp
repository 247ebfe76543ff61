// Reads the includes of every source file and checks the arrows of the design:
// linking alone cannot, because distribution packages put every header where
// every target can see it.

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <regex>
#include <string>
#include <string_view>
#include <vector>

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;

bool starts_with_any(std::string_view text, std::initializer_list<std::string_view> prefixes) {
  return std::ranges::any_of(prefixes, [&](std::string_view prefix) { return text.starts_with(prefix); });
}

// Middleware headers and what fastddsgen makes of idl/msg.
bool is_dds(std::string_view include) {
  return starts_with_any(include, {"fastdds/", "fastrtps/", "fastcdr/", "idl/msg/"}) ||
         include.find("_msgs/") != std::string_view::npos || include.find("PubSubTypes") != std::string_view::npos;
}

bool is_engine(std::string_view include) { return starts_with_any(include, {"mujoco"}); }

constexpr std::string_view kRooms[] = {"idl/",        "physics_pool/", "planners/", "robot_bridge/",
                                       "perception/", "services/",     "tests/"};

bool is_ours(std::string_view include) {
  return std::ranges::any_of(kRooms, [&](std::string_view room) { return include.starts_with(room); });
}

// Why `file` must not include `include`; empty if it may. Paths are relative to
// the source directory.
std::string objection(std::string_view file, std::string_view include) {
  const bool in_tests = file.starts_with("tests/");
  if (is_dds(include) && !in_tests && !starts_with_any(file, {"services/", "idl/convert/", "idl/msg/"})) {
    return "only services/ speaks DDS";
  }
  if (file.starts_with("services/bag") &&
      (is_dds(include) || (include.starts_with("services/dds/") && include != "services/dds/qos.hpp"))) {
    return "bags are files: of DDS they know what a topic promises, which is a plain value";
  }
  if (is_engine(include) && !in_tests && !starts_with_any(file, {"physics_pool/local/", "physics_pool/render/"})) {
    return "only physics_pool/local and physics_pool/render speak MuJoCo";
  }
  if (include.starts_with("tests/") && !in_tests) return "nothing may include tests";
  if (!is_ours(include) || in_tests) return "";

  const auto allow = [&](std::initializer_list<std::string_view> prefixes, std::string rule) {
    return starts_with_any(include, prefixes) ? "" : rule;
  };
  if (file.starts_with("idl/types/")) return allow({"idl/types/"}, "idl/types stands alone");
  if (file.starts_with("idl/")) {
    return starts_with_any(include, {"planners/", "services/", "physics_pool/local/", "physics_pool/render/"})
               ? "idl converts values and knows no planner, service or engine"
               : "";
  }
  if (starts_with_any(file, {"physics_pool/api/", "physics_pool/scene/", "physics_pool/objective/",
                             "physics_pool/sampling/", "physics_pool/coarse/", "physics_pool/parareal/"})) {
    return allow({"idl/types/", "physics_pool/api/", "physics_pool/scene/", "physics_pool/objective/",
                  "physics_pool/sampling/", "physics_pool/coarse/", "physics_pool/parareal/"},
                 "the engine-free half of physics_pool knows values only");
  }
  if (file.starts_with("physics_pool/")) {
    return allow({"idl/types/", "physics_pool/"}, "physics_pool knows values and itself");
  }
  if (file.starts_with("robot_bridge/")) {
    return allow({"idl/types/", "robot_bridge/"}, "robot_bridge knows values and itself");
  }
  if (file.starts_with("perception/")) {
    return allow({"idl/types/", "perception/"}, "perception knows values and itself");
  }
  if (file.starts_with("planners/")) {
    return allow({"idl/types/", "planners/", "physics_pool/api/", "physics_pool/scene/", "physics_pool/objective/",
                  "physics_pool/sampling/", "robot_bridge/api/", "perception/api/"},
                 "planners know a Pool and the two ports, never what is behind them");
  }
  return "";
}

struct Include {
  int line = 0;
  std::string path;
};

std::vector<Include> includes_of(std::istream& source) {
  static const std::regex kInclude(R"(^\s*#\s*include\s*[<"]([^>"]+)[>"])");
  std::vector<Include> result;
  std::string text;
  for (int line = 1; std::getline(source, text); ++line) {
    std::smatch match;
    if (std::regex_search(text, match, kInclude)) result.push_back({line, match[1]});
  }
  return result;
}

// Every C++ file of the rooms, relative to the source directory.
std::vector<fs::path> source_files() {
  const fs::path root = JOSTLE_SOURCE_DIR;
  std::vector<fs::path> files;
  for (const std::string_view room : kRooms) {
    if (!fs::exists(root / room)) continue;
    for (const fs::directory_entry& entry : fs::recursive_directory_iterator(root / room)) {
      const auto extension = entry.path().extension();
      if (extension == ".cpp" || extension == ".hpp" || extension == ".h") {
        files.push_back(fs::relative(entry.path(), root));
      }
    }
  }
  std::ranges::sort(files);
  return files;
}

TEST(Architecture, EveryIncludeFollowsTheArrows) {
  const auto files = source_files();
  ASSERT_GT(files.size(), 40u) << "are these the sources? " << JOSTLE_SOURCE_DIR;
  for (const fs::path& file : files) {
    std::ifstream source(fs::path(JOSTLE_SOURCE_DIR) / file);
    for (const Include& include : includes_of(source)) {
      const std::string why = objection(file.generic_string(), include.path);
      EXPECT_TRUE(why.empty()) << file.generic_string() << ":" << include.line << ": includes " << include.path
                               << ", but " << why;
    }
  }
}

TEST(Architecture, OurIncludesExist) {
  for (const fs::path& file : source_files()) {
    std::ifstream source(fs::path(JOSTLE_SOURCE_DIR) / file);
    for (const Include& include : includes_of(source)) {
      if (!is_ours(include.path) || is_dds(include.path)) continue;
      EXPECT_TRUE(fs::exists(fs::path(JOSTLE_SOURCE_DIR) / include.path))
          << file.generic_string() << ":" << include.line << ": no " << include.path;
    }
  }
}

TEST(Architecture, HeadersAreIncludedOnce) {
  for (const fs::path& file : source_files()) {
    if (file.extension() != ".hpp") continue;
    std::ifstream source(fs::path(JOSTLE_SOURCE_DIR) / file);
    std::string first;
    std::getline(source, first);
    EXPECT_EQ(first, "#pragma once") << file.generic_string();
  }
}

// The check itself: what it must refuse and what it must let pass.
struct Arrow {
  const char *file, *include;
  bool is_allowed;
};

TEST(Objection, IsRaisedForWrongArrowsOnly) {
  const std::vector<Arrow> arrows{
      {"planners/pbsto/pbsto.cpp", "fastdds/dds/domain/DomainParticipant.hpp", false},
      {"physics_pool/api/pool.hpp", "fastcdr/Cdr.h", false},
      {"perception/mocap/mocap.cpp", "sensor_msgs/msg/JointState.h", false},
      {"services/worker/main.cpp", "fastdds/dds/domain/DomainParticipant.hpp", true},
      {"idl/convert/state.cpp", "jostle_msgs/msg/RolloutPubSubTypes.h", true},
      {"tests/integration/pool_test.cpp", "fastrtps/utils/IPLocator.h", true},
      {"physics_pool/local/world.cpp", "mujoco/mujoco.h", true},
      {"physics_pool/render/renderer.cpp", "mujoco/mujoco.h", true},
      {"physics_pool/scene/scene.cpp", "mujoco/mujoco.h", false},
      {"physics_pool/coarse/learned/forward.cpp", "mujoco/mujoco.h", false},
      {"physics_pool/coarse/learned/forward.cpp", "physics_pool/local/world.hpp", false},
      {"physics_pool/coarse/learned/forward.cpp", "physics_pool/scene/scene.hpp", true},
      {"services/worker/main.cpp", "mujoco/mujoco.h", false},
      {"services/bag/mcap_writer.cpp", "fastcdr/Cdr.h", false},
      {"services/bag_cli/info.cpp", "services/dds/participant.hpp", false},
      {"services/bag/message.hpp", "services/dds/qos.hpp", true},
      {"planners/pbsto/pbsto.cpp", "mujoco.h", false},
      {"planners/pbsto/pbsto.cpp", "physics_pool/api/pool.hpp", true},
      {"planners/pbsto/pbsto.cpp", "physics_pool/local/thread_pool.hpp", false},
      {"planners/pbsto/pbsto.cpp", "physics_pool/render/renderer.hpp", false},
      {"planners/control/controller.cpp", "services/config/parameters.hpp", false},
      {"planners/control/controller.cpp", "robot_bridge/api/robot.hpp", true},
      {"planners/control/controller.cpp", "robot_bridge/fake/fake.hpp", false},
      {"idl/types/state.hpp", "physics_pool/api/pool.hpp", false},
      {"idl/types/state.hpp", "idl/types/result.hpp", true},
      {"idl/types/state.hpp", "vector", true},
      {"physics_pool/scene/scene.cpp", "physics_pool/local/world.hpp", false},
      {"physics_pool/local/world.cpp", "planners/api/planner.hpp", false},
      {"robot_bridge/api/robot.hpp", "perception/api/object_source.hpp", false},
      {"services/config/parameters.cpp", "planners/pbsto/pbsto.hpp", true},
      {"services/config/parameters.cpp", "tests/support/scenes.hpp", false},
      {"tests/unit/a_test.cpp", "tests/support/scenes.hpp", true},
  };
  for (const Arrow& arrow : arrows) {
    EXPECT_EQ(objection(arrow.file, arrow.include).empty(), arrow.is_allowed)
        << arrow.file << " includes " << arrow.include;
  }
}

TEST(IncludesOf, FindsBothKindsAndNoComments) {
  std::istringstream source("// #include <a>\n#include <b>\n  #  include \"c/d.hpp\"\nint include;\n");
  const auto includes = includes_of(source);
  ASSERT_EQ(includes.size(), 2u);
  EXPECT_EQ(includes[0].path, "b");
  EXPECT_EQ(includes[0].line, 2);
  EXPECT_EQ(includes[1].path, "c/d.hpp");
}

}  // namespace
}  // namespace jostle::tests
