#include "services/tools/launcher/programs.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <string_view>
#include <utility>

namespace jostle::tools {
namespace {

// Sorted by name.
constexpr auto kPurposes = std::to_array<std::pair<std::string_view, std::string_view>>({
    {"bag", "look into recordings, check, save and export them"},
    {"bench", "measure physics, pools and planners on this machine"},
    {"coordinator", "plan and re-plan with a pool of workers"},
    {"discovery-server", "introduce machines to each other where there is no multicast"},
    {"doctor", "say what is wrong with this machine, and the remedy"},
    {"experiment", "run a study of the thesis and write its figure or table"},
    {"goal", "give a scene to a coordinator and a world that run"},
    {"keys", "make, hand out and revoke identities for protected DDS"},
    {"parameters", "list the parameters of planners and controllers, and their defaults"},
    {"play", "publish what is in a bag, at any speed, from any moment"},
    {"record", "write topics into a bag"},
    {"render", "draw states of a scene, or a recorded run"},
    {"replay", "make the decisions of a recorded run again, and compare"},
    {"run", "start everything for a scene on this machine"},
    {"scene", "make, check, disturb and show scene files"},
    {"sim", "simulate the world in which actions happen"},
    {"train-coarse", "train the learned coarse model of pushing"},
    {"worker", "simulate rollouts for whoever asks"},
});

// Levenshtein's distance, one row at a time.
std::size_t edits(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, replaced});
    }
  }
  return row.back();
}

}  // namespace

std::filesystem::path program_file(const std::filesystem::path& folder, const std::string& name) {
  std::string file = "jostle_" + name;
  std::ranges::replace(file, '-', '_');
  return folder / file;
}

std::vector<Program> installed_programs(const std::filesystem::path& folder) {
  std::vector<Program> programs;
  for (const auto& [name, purpose] : kPurposes) {
    if (access(program_file(folder, std::string(name)).c_str(), X_OK) != 0) continue;
    programs.push_back({.name = std::string(name), .purpose = std::string(purpose)});
  }
  return programs;
}

std::string nearest(const std::vector<Program>& programs, const std::string& name) {
  // Every second letter wrong is no misspelling any more.
  std::size_t fewest = name.size() / 2 + 1;
  std::string found;
  for (const Program& program : programs) {
    const std::size_t needed = edits(name, program.name);
    if (needed >= fewest) continue;
    fewest = needed;
    found = program.name;
  }
  return found;
}

}  // namespace jostle::tools
