#include "services/common/process/cores.hpp"

#include <fmt/format.h>
#include <sched.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "idl/types/number.hpp"
#include "services/common/process/command_line.hpp"

namespace jostle::common {
namespace {

constexpr int kMost = 1024;  // threads or processes

// "2,3,6-8" of 2, 3, 6, 7 and 8.
std::string ranges_of(const std::vector<int>& cores) {
  std::string text;
  for (std::size_t i = 0; i < cores.size();) {
    std::size_t last = i;
    while (last + 1 < cores.size() && cores[last + 1] == cores[last] + 1) ++last;
    text += fmt::format("{}{}", text.empty() ? "" : ",", cores[i]);
    if (last > i) text += fmt::format("-{}", cores[last]);
    i = last + 1;
  }
  return text;
}

std::optional<int> parse_core(const std::string& text) { return parse_whole(text, 0, CPU_SETSIZE - 1); }

// Version 2's line of /proc/self/cgroup: "0::/the/group".
std::string own_group() {
  std::ifstream file("/proc/self/cgroup");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("0::")) return line.substr(3);
  }
  return "/";
}

}  // namespace

std::vector<int> allowed_cores() {
  std::vector<int> cores;
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof set, &set) == 0) {
    for (int core = 0; core < CPU_SETSIZE; ++core) {
      if (CPU_ISSET(core, &set)) cores.push_back(core);
    }
  }
  if (cores.empty()) cores.push_back(0);  // more cores than a set has room for
  return cores;
}

std::optional<double> cpu_quota(const std::filesystem::path& root, const std::string& group) {
  std::optional<double> least;
  for (std::filesystem::path path = std::filesystem::path(group).relative_path();; path = path.parent_path()) {
    std::ifstream file(root / path / "cpu.max");  // "QUOTA PERIOD", microseconds, or "max PERIOD"
    double quota = 0.0, period = 0.0;
    if (file >> quota >> period && quota > 0 && period > 0) least = std::min(least.value_or(HUGE_VAL), quota / period);
    if (path.empty()) return least;
  }
}

int usable_cores() {
  const auto allowed = static_cast<int>(allowed_cores().size());
  const auto quota = cpu_quota("/sys/fs/cgroup", own_group());
  return quota ? std::clamp(static_cast<int>(std::ceil(*quota)), 1, allowed) : allowed;
}

Result<std::vector<int>> parse_cores(const std::string& text, const std::vector<int>& allowed) {
  std::vector<int> cores;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    const auto dash = part.find('-');
    const auto first = parse_core(part.substr(0, dash));
    const auto last = dash == std::string::npos ? first : parse_core(part.substr(dash + 1));
    if (!first || !last || *last < *first) {
      return Error{Code::kInvalidArgument, fmt::format("cores: got '{}', wanted a list such as 2,3,6-8", text)};
    }
    for (int core = *first; core <= *last; ++core) {
      if (!std::ranges::binary_search(allowed, core)) {
        return Error{Code::kInvalidArgument, fmt::format("cores: got {}, wanted some of {}, which this process may use",
                                                         core, ranges_of(allowed))};
      }
      if (std::ranges::find(cores, core) != cores.end()) {
        return Error{Code::kInvalidArgument, fmt::format("cores: got {} twice in '{}', wanted it once", core, text)};
      }
      cores.push_back(core);
    }
  }
  if (cores.empty()) return Error{Code::kInvalidArgument, "cores: got none, wanted a list such as 2,3,6-8"};
  return cores;
}

Result<std::vector<int>> one_core_each(const std::vector<int>& cores, int threads) {
  if (static_cast<int>(cores.size()) < threads) {
    return Error{Code::kInvalidArgument, fmt::format("cores: got {} ({}) for {} threads, wanted one for each",
                                                     cores.size(), ranges_of(cores), threads)};
  }
  return std::vector<int>(cores.begin(), cores.begin() + threads);
}

CLI::Option* add_count_option(CLI::App& app, const std::string& name, int& count, int least, const std::string& help) {
  const CLI::Validator automatic(
      [least](std::string& text) {
        if (text == "auto") text = std::to_string(usable_cores());
        if (parse_whole(text, least, kMost)) return std::string();
        return fmt::format("got '{}', wanted auto or {} to {}", text, least, kMost);
      },
      "");
  auto* option = app.add_option(name, count, help)->transform(automatic)->type_name("N|auto");
  suggest(option, {"auto"});
  return option;
}

}  // namespace jostle::common
