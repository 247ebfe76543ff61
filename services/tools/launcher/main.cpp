// jostle: runs the program jostle_NAME that lies beside it, the way git does.

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/common/process/standard_streams.hpp"
#include "services/tools/launcher/programs.hpp"

namespace jostle::tools {
namespace {

int show_help(const std::filesystem::path& folder) {
  fmt::print(
      "Plans and executes physics-based manipulation, on as many machines as there are.\n\n"
      "usage: jostle NAME ARGUMENTS…    runs a program\n"
      "       jostle help NAME          says what a program takes\n"
      "       jostle --version\n\n"
      "programs:\n");
  for (const Program& program : installed_programs(folder)) {
    fmt::print("  {:16} {}\n", program.name, program.purpose);
  }
  return 0;
}

int complain(const std::filesystem::path& folder, const std::string& name) {
  const std::string meant = nearest(installed_programs(folder), name);
  fmt::print(stderr, "jostle: no program '{}' in {}; {}\n", name, folder.string(),
             meant.empty() ? "`jostle help` lists what there is" : fmt::format("did you mean `jostle {}`?", meant));
  return common::kExitUsage;
}

// Becomes the program; returns only if that failed.
int become(const std::filesystem::path& folder, const std::string& name, std::vector<char*> arguments) {
  const std::string file = program_file(folder, name).string();
  if (name.empty() || name.front() == '-' || name.find('/') != std::string::npos || access(file.c_str(), X_OK) != 0) {
    return complain(folder, name);
  }
  arguments.insert(arguments.begin(), const_cast<char*>(file.c_str()));  // execv promises not to write
  arguments.push_back(nullptr);
  execv(file.c_str(), arguments.data());
  fmt::print(stderr, "jostle: {} cannot be run: {}\n", file, std::strerror(errno));
  return common::kExitBroken;
}

int launch(const std::vector<char*>& arguments) {
  const std::filesystem::path folder = common::program_folder();
  if (arguments.empty()) {
    show_help(folder);
    return common::kExitUsage;
  }
  const std::string name = arguments[0];
  if (name == "--version") {
    fmt::print("jostle {}\n", JOSTLE_VERSION);
    return 0;
  }
  const bool asks_for_help = name == "help" || name == "--help" || name == "-h";
  if (!asks_for_help) return become(folder, name, {arguments.begin() + 1, arguments.end()});
  if (arguments.size() == 1) return show_help(folder);
  std::string help = "--help";
  return become(folder, arguments[1], {help.data()});
}

}  // namespace
}  // namespace jostle::tools

int main(int argc, char** argv) {
  jostle::common::guard_standard_streams("jostle");
  return jostle::tools::launch({argv + 1, argv + argc});
}
