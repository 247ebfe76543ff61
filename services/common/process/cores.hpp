#pragma once
/// \file
/// Cores: which this process may use, and what the command line says of them.

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace jostle::common {

/// Returns the cores that this process may use: its affinity, which cpusets narrow. Ascending,
/// at least one.
std::vector<int> allowed_cores();

/// How many cores' worth of time a control group (version 2) leaves this process, if
/// it limits it. `root` is where groups are mounted, `group` the process's own
/// ("/system.slice/x"); the groups above it count too.
std::optional<double> cpu_quota(const std::filesystem::path& root, const std::string& group);

/// Returns how many threads are worth having: as many as allowed cores, or fewer where the control group's quota
/// pays for fewer.
int usable_cores();

/// Reads "2,3,6-8" as 2, 3, 6, 7, 8, in the order given.
/// Errors   kInvalidArgument  no such list, a core twice, or one that is not allowed
Result<std::vector<int>> parse_cores(const std::string& text, const std::vector<int>& allowed);

/// Gives each of `threads` threads a core: the first ones of `cores`.
/// Errors   kInvalidArgument  too few of them
Result<std::vector<int>> one_core_each(const std::vector<int>& cores, int threads);

/// Adds an option that takes a number from `least` to 1024, or `auto`: usable_cores().
CLI::Option* add_count_option(CLI::App& app, const std::string& name, int& count, int least, const std::string& help);

}  // namespace jostle::common
