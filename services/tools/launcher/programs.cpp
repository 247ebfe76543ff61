#include "services/tools/launcher/programs.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <string_view>
#include <utility>

namespace jostle::tools {
namespace {

// Sorted by name.
constexpr auto kPurposes = std::to_array<std::pair<std::string_view, std::string_view>>({
    {"bag", "look into recordings, check, save and export them"},
    {"bench", "measure physics, pools and planners on this machine"},
    {"bridge", "drive a robot by its own protocols"},
    {"perceive", "publish what motion capture or a camera sees of the objects"},
    {"calibrate", "find a camera's intrinsics, and where it is, from pictures of printed tags"},
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
    {"tags", "print tags for cameras in true size"},
    {"train-coarse", "train the learned coarse model of pushing"},
    {"ur-sim", "simulate a UR5 and its gripper behind their own protocols"},
    {"view", "show a run or a bag in a browser and in Foxglove"},
    {"worker", "simulate rollouts for whoever asks"},
    {"workers", "list the workers of a domain, and whom they serve"},
});

}  // namespace

std::filesystem::path program_file(const std::filesystem::path& folder, const std::string& name) {
  std::string file = "jostle_" + name;
  std::ranges::replace(file, '-', '_');
  return folder / file;
}

std::vector<Program> all_programs() {
  std::vector<Program> programs;
  for (const auto& [name, purpose] : kPurposes) {
    programs.push_back({.name = std::string(name), .purpose = std::string(purpose)});
  }
  return programs;
}

std::vector<Program> installed_programs(const std::filesystem::path& folder) {
  std::vector<Program> programs = all_programs();
  std::erase_if(programs,
                [&](const Program& one) { return access(program_file(folder, one.name).c_str(), X_OK) != 0; });
  return programs;
}

std::vector<std::string> names_of(const std::vector<Program>& programs) {
  std::vector<std::string> names;
  for (const Program& program : programs) names.push_back(program.name);
  return names;
}

}  // namespace jostle::tools
