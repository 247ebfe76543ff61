#pragma once
/// \file
/// The programs of an installation: those named jostle_… in one folder.

#include <filesystem>
#include <string>
#include <vector>

namespace jostle::services {

/// A program as a user names it, with dashes: `train-coarse` is jostle_train_coarse.
struct Program {
  std::string name;
  std::string purpose;  ///< one line; empty for a program this launcher does not know
};

/// Where a program of that name is or would be.
std::filesystem::path program_file(const std::filesystem::path& folder, const std::string& name);

/// What can be run from `folder`, sorted by name. Empty if it cannot be read.
std::vector<Program> installed_programs(const std::filesystem::path& folder);

/// The program whose name takes the fewest edits to reach, or "" when none is near.
std::string nearest(const std::vector<Program>& programs, const std::string& name);

}  // namespace jostle::services
