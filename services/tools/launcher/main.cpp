// jostle: runs the program jostle_NAME that lies beside it, the way git does.

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <string>
#include <vector>

#include "idl/text/nearest.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/common/process/standard_streams.hpp"
#include "services/tools/launcher/programs.hpp"

namespace jostle::tools {
namespace {

int show_help(const std::filesystem::path& folder) {
  fmt::print(
      "Plans and executes physics-based manipulation, on as many machines as there are.\n\n"
      "usage: jostle NAME ARGUMENTS…            runs a program\n"
      "       jostle help NAME [SUBCOMMAND]     says what a program takes; man jostle-NAME says it, too\n"
      "       jostle --version\n\n"
      "programs:\n");
  for (const Program& program : installed_programs(folder)) {
    fmt::print("  {:16} {}\n", program.name, program.purpose);
  }
  return 0;
}

int complain(const std::filesystem::path& folder, const std::string& name) {
  const std::string meant = nearest(name, names_of(installed_programs(folder)));
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

// What may stand at the place of the last word: programs, or what the program there says.
int complete(const std::filesystem::path& folder, std::vector<char*> words) {
  if (words.empty()) return common::kExitUsage;
  const bool is_help = words.size() > 1 && words[0] == std::string("help");
  if (is_help) words.erase(words.begin());
  if (words.size() == 1) {
    for (const Program& program : installed_programs(folder)) fmt::print("{}\t{}\n", program.name, program.purpose);
    if (!is_help) fmt::print("help\tsay what a program takes\n");
    return common::kExitOk;
  }
  const std::string name = words[0];
  std::string request = "--complete";
  words[0] = request.data();
  return become(folder, name, words);
}

// The list of programs for jostle(1), or one program's page.
int show_manual(const std::filesystem::path& folder, const std::vector<char*>& words) {
  if (words.empty()) {
    for (const Program& program : all_programs()) {
      fmt::print(".It Xr jostle-{} 1\n{}\n", program.name, program.purpose);
    }
    return common::kExitOk;
  }
  for (const Program& program : all_programs()) {
    if (program.name != words[0]) continue;
    std::string request = "--man", purpose = program.purpose;
    return become(folder, program.name, {request.data(), purpose.data()});
  }
  return complain(folder, words[0]);
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
  if (name == "--complete") return complete(folder, {arguments.begin() + 1, arguments.end()});
  if (name == "--man") return show_manual(folder, {arguments.begin() + 1, arguments.end()});
  const bool asks_for_help = name == "help" || name == "--help" || name == "-h";
  if (!asks_for_help) return become(folder, name, {arguments.begin() + 1, arguments.end()});
  if (arguments.size() == 1) return show_help(folder);
  std::string help = "--help-of";
  std::vector<char*> words{help.data()};
  words.insert(words.end(), arguments.begin() + 2, arguments.end());
  return become(folder, arguments[1], words);
}

}  // namespace
}  // namespace jostle::tools

int main(int argc, char** argv) {
  jostle::common::guard_standard_streams("jostle");
  return jostle::tools::launch({argv + 1, argv + argc});
}
