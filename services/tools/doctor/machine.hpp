#pragma once
/// \file
/// Processors, libraries and programs.

#include <vector>

#include "services/tools/doctor/check.hpp"

namespace jostle::tools {

/// Checks the cores, and whether others keep them busy.
Check check_cores();

/// Checks MuJoCo's and Fast DDS's versions.
std::vector<Check> check_versions();

/// Checks that a worker lies beside this program.
Check check_worker();

}  // namespace jostle::tools
