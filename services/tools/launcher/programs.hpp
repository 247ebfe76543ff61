#pragma once
/// \file
/// The programs of an installation: those named jostle_… in one folder.

#include <filesystem>
#include <string>
#include <vector>

namespace jostle::tools {

/// A program as a user names it, with dashes: `train-coarse` is jostle_train_coarse.
struct Program {
  std::string name;
  std::string purpose;  ///< one line
};

/// Returns where a program of that name is or would be.
std::filesystem::path program_file(const std::filesystem::path& folder, const std::string& name);

/// Lists those of Jostle's programs that are there, sorted by name. Others named
/// jostle_… (tests, a user's own) can be run, yet are not listed.
std::vector<Program> installed_programs(const std::filesystem::path& folder);

/// Lists all of Jostle's programs, whatever of them is installed.
std::vector<Program> all_programs();

std::vector<std::string> names_of(const std::vector<Program>& programs);

}  // namespace jostle::tools
