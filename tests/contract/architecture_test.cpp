// Reads the includes of every source file and checks the arrows of the design:
// linking alone cannot, because distribution packages put every header where
// every target can see it.

#include <gmock/gmock.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace jostle::tests {
namespace {

namespace fs = std::filesystem;

bool starts_with_any(std::string_view text, std::initializer_list<std::string_view> prefixes) {
  return std::ranges::any_of(prefixes, [&](std::string_view prefix) { return text.starts_with(prefix); });
}

// Middleware headers.
bool is_dds(std::string_view include) { return starts_with_any(include, {"fastdds/", "fastrtps/", "fastcdr/"}); }

// What fastddsgen makes of idl/msg.
bool is_wire_type(std::string_view include) {
  return include.starts_with("idl/msg/") || include.find("_msgs/") != std::string_view::npos ||
         include.find("PubSubTypes") != std::string_view::npos;
}

bool is_engine(std::string_view include) { return starts_with_any(include, {"mujoco"}); }

constexpr std::string_view kRooms[] = {"idl/",        "physics_pool/", "planners/", "robot_bridge/",
                                       "perception/", "services/",     "tests/"};

bool is_ours(std::string_view include) {
  return std::ranges::any_of(kRooms, [&](std::string_view room) { return include.starts_with(room); });
}

// Who may include what, beside itself. The first row that a path begins with is the row of its room.
struct Room {
  std::string_view path;
  std::vector<std::string_view> may_include;
};

const std::vector<Room> kArrows{
    {"idl/types/", {}},
    {"idl/files/", {"idl/types/"}},
    {"idl/text/", {"idl/types/", "idl/files/"}},
    {"physics_pool/robot/", {"idl/"}},
    {"physics_pool/sampling/", {"idl/types/"}},
    {"physics_pool/scene/", {"idl/", "physics_pool/robot/"}},
    {"physics_pool/task/", {"idl/types/", "physics_pool/robot/", "physics_pool/scene/"}},
    {"physics_pool/objective/", {"idl/types/", "physics_pool/scene/", "physics_pool/task/"}},
    {"physics_pool/api/", {"idl/types/", "physics_pool/scene/", "physics_pool/sampling/", "physics_pool/objective/"}},
    {"physics_pool/uncertainty/", {"idl/types/", "idl/text/", "physics_pool/scene/", "physics_pool/sampling/"}},
    {"physics_pool/scenarios/", {"idl/types/", "physics_pool/robot/", "physics_pool/scene/", "physics_pool/sampling/"}},
    {"physics_pool/coarse/", {"idl/types/", "idl/files/", "idl/text/", "physics_pool/scene/"}},
    {"physics_pool/feasible/", {"idl/types/", "physics_pool/coarse/", "physics_pool/scene/"}},
    {"physics_pool/parareal/", {"idl/types/", "physics_pool/api/", "physics_pool/coarse/"}},
    {"physics_pool/local/",
     {"idl/types/", "physics_pool/robot/", "physics_pool/scene/", "physics_pool/sampling/", "physics_pool/objective/",
      "physics_pool/api/"}},
    {"physics_pool/render/", {"idl/types/", "idl/files/", "idl/text/", "physics_pool/scene/", "physics_pool/local/"}},
    {"robot_bridge/", {"idl/types/"}},
    {"perception/camera/", {"idl/types/", "idl/files/", "idl/text/"}},
    {"perception/", {"idl/types/"}},
    {"planners/approach/", {"idl/types/", "physics_pool/robot/", "physics_pool/task/"}},
    // Only this planner knows cheaper physics than the Pool's.
    {"planners/guided/",
     {"idl/types/", "physics_pool/task/", "physics_pool/objective/", "physics_pool/api/", "physics_pool/sampling/",
      "physics_pool/coarse/", "planners/api/", "planners/approach/", "planners/pbsto/", "planners/search/"}},
    {"planners/",
     {"idl/types/", "idl/text/", "physics_pool/task/", "physics_pool/objective/", "physics_pool/api/",
      "physics_pool/uncertainty/", "robot_bridge/api/", "perception/api/"}},
};

// The families of services, lowest first: each may include those before it, and every other room.
constexpr std::string_view kFamilies[] = {"common", "wire", "pool", "world", "task", "bags", "studies", "tools"};

std::size_t floor_of(std::string_view path) {
  path.remove_prefix(std::string_view("services/").size());
  const auto family = std::ranges::find(kFamilies, path.substr(0, path.find('/')));
  return static_cast<std::size_t>(family - std::begin(kFamilies));
}

// Bags are files: whoever only reads or writes them starts without a middleware.
bool is_bag_file(std::string_view file) {
  return starts_with_any(file, {"services/bags/format/", "services/bags/tool/", "services/bags/selection"});
}

// Why `file` must not include `include`; empty if it may. Paths are relative to
// the source directory.
std::string objection(std::string_view file, std::string_view include) {
  if (file.starts_with("tests/")) return "";
  if (include.starts_with("tests/")) return "nothing may include tests";
  if (is_dds(include)) return file.starts_with("services/wire/") ? "" : "only services/wire speaks DDS";
  if (is_wire_type(include)) {
    if (!file.starts_with("services/")) return "only services know wire types";
    return is_bag_file(file) ? "bags are files, whatever the types in them" : "";
  }
  if (is_engine(include)) {
    return starts_with_any(file, {"physics_pool/local/", "physics_pool/render/"})
               ? ""
               : "only physics_pool/local and physics_pool/render speak MuJoCo";
  }
  if (!is_ours(include)) return "";
  if (file.starts_with("services/")) {
    if (is_bag_file(file) && include.starts_with("services/wire/")) return "bags are files: they know no wire";
    if (!include.starts_with("services/") || floor_of(include) <= floor_of(file)) return "";
    return "families of services lean on those below them only: common, wire, pool, world, task, bags, studies, tools";
  }
  const auto room = std::ranges::find_if(kArrows, [&](const Room& r) { return file.starts_with(r.path); });
  if (room == kArrows.end()) return "this folder has no row in kArrows";
  const auto may = [&](std::string_view path) { return include.starts_with(path); };
  if (may(room->path) || std::ranges::any_of(room->may_include, may)) return "";
  std::string wanted;
  for (const std::string_view path : room->may_include) wanted += (wanted.empty() ? "" : ", ") + std::string(path);
  return "this room may include itself and: " + wanted;
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

// What a file sees by way of the headers that it includes, itself left out.
std::set<std::string> closure_of(const std::string& file) {
  static std::map<std::string, std::vector<Include>> known;
  std::set<std::string> seen;
  std::vector<std::string> open{file};
  while (!open.empty()) {
    const std::string path = open.back();
    open.pop_back();
    if (!known.contains(path)) {
      std::ifstream source(fs::path(JOSTLE_SOURCE_DIR) / path);
      known[path] = includes_of(source);
    }
    for (const Include& include : known[path]) {
      if (seen.insert(include.path).second && is_ours(include.path)) open.push_back(include.path);
    }
  }
  return seen;
}

TEST(Architecture, EngineAndMiddlewareAreOutOfReachByDetoursToo) {
  for (const fs::path& path : source_files()) {
    const std::string file = path.generic_string();
    if (starts_with_any(file, {"tests/", "physics_pool/local/", "physics_pool/render/"})) continue;
    for (const std::string& include : closure_of(file)) {
      EXPECT_FALSE(is_engine(include)) << file << " sees " << include << " by way of a header";
      if (file.starts_with("services/") && !is_bag_file(file)) continue;
      EXPECT_FALSE(is_dds(include) || is_wire_type(include)) << file << " sees " << include << " by way of a header";
    }
  }
}

TEST(Architecture, NoHeaderSeesItself) {
  for (const fs::path& path : source_files()) {
    const std::string file = path.generic_string();
    EXPECT_FALSE(closure_of(file).contains(file)) << file << " is in a circle of includes";
  }
}

TEST(Architecture, ProgramsAreIncludedByNobody) {
  std::set<fs::path> programs;
  for (const fs::path& file : source_files()) {
    if (file.filename() == "main.cpp") programs.insert(file.parent_path());
  }
  ASSERT_GT(programs.size(), 10u);
  for (const fs::path& file : source_files()) {
    if (file.generic_string().starts_with("tests/")) continue;
    for (const std::string& include : closure_of(file.generic_string())) {
      const fs::path folder = fs::path(include).parent_path();
      EXPECT_TRUE(!programs.contains(folder) || folder == file.parent_path())
          << file.generic_string() << " sees " << include << ", which is a program's";
    }
  }
}

TEST(Architecture, OurIncludesExist) {
  for (const fs::path& file : source_files()) {
    std::ifstream source(fs::path(JOSTLE_SOURCE_DIR) / file);
    for (const Include& include : includes_of(source)) {
      if (!is_ours(include.path) || is_wire_type(include.path)) continue;
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
      {"services/wire/dds/participant.cpp", "fastdds/dds/domain/DomainParticipant.hpp", true},
      {"services/pool/worker/main.cpp", "fastdds/dds/domain/DomainParticipant.hpp", false},
      {"services/wire/convert/pool.cpp", "idl/msg/poolPubSubTypes.h", true},
      {"services/task/session/journal.hpp", "idl/msg/task.h", true},
      {"tests/integration/pool_test.cpp", "fastrtps/utils/IPLocator.h", true},
      {"physics_pool/local/world.cpp", "mujoco/mujoco.h", true},
      {"physics_pool/render/renderer.cpp", "mujoco/mujoco.h", true},
      {"physics_pool/scene/scene.cpp", "mujoco/mujoco.h", false},
      {"physics_pool/coarse/learned/forward.cpp", "mujoco/mujoco.h", false},
      {"physics_pool/coarse/learned/forward.cpp", "physics_pool/local/world.hpp", false},
      {"physics_pool/coarse/learned/forward.cpp", "physics_pool/scene/scene.hpp", true},
      {"physics_pool/new_room/file.cpp", "physics_pool/scene/scene.hpp", false},
      {"services/pool/worker/main.cpp", "mujoco/mujoco.h", false},
      {"services/bags/format/mcap_writer.cpp", "fastcdr/Cdr.h", false},
      {"services/bags/tool/info.cpp", "services/wire/dds/participant.hpp", false},
      {"services/bags/format/message.hpp", "idl/types/qos.hpp", true},
      {"services/bags/play/player.cpp", "services/wire/dds/participant.hpp", true},
      {"services/wire/dds/participant.cpp", "services/common/process/domain.hpp", true},
      {"services/wire/dds/participant.cpp", "services/pool/protocol.hpp", false},
      {"services/common/process/files.cpp", "services/wire/dds/names.hpp", false},
      {"services/studies/bench/main.cpp", "services/tools/doctor/check.hpp", false},
      {"planners/pbsto/pbsto.cpp", "mujoco.h", false},
      {"planners/pbsto/pbsto.cpp", "physics_pool/api/pool.hpp", true},
      {"planners/pbsto/pbsto.cpp", "physics_pool/local/thread_pool.hpp", false},
      {"planners/pbsto/pbsto.cpp", "physics_pool/render/renderer.hpp", false},
      {"planners/control/controller.cpp", "services/task/config/parameters.hpp", false},
      {"planners/control/controller.cpp", "robot_bridge/api/robot.hpp", true},
      {"planners/control/controller.cpp", "robot_bridge/fake/fake.hpp", false},
      {"idl/types/state.hpp", "physics_pool/api/pool.hpp", false},
      {"idl/types/state.hpp", "idl/types/result.hpp", true},
      {"idl/types/state.hpp", "vector", true},
      {"physics_pool/scene/scene.cpp", "physics_pool/local/world.hpp", false},
      {"physics_pool/local/world.cpp", "planners/api/planner.hpp", false},
      {"robot_bridge/api/robot.hpp", "perception/api/object_source.hpp", false},
      {"services/task/config/parameters.cpp", "planners/pbsto/pbsto.hpp", true},
      {"services/task/config/parameters.cpp", "tests/support/scenes.hpp", false},
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
