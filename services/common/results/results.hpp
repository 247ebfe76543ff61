#pragma once
/// \file
/// Result files: numbers, and where they come from.

#include <filesystem>
#include <nlohmann/json.hpp>

#include "idl/types/result.hpp"

namespace jostle::common {

/// Returns version, commit, build, command, machine, cores, load average over a minute (now, and when the program
/// began), beginning (UTC) and duration so far, s. Seeds and parameters are not among them: the command says them, or
/// the results hold them.
nlohmann::json provenance();

/// Writes results with a key `provenance`; a list becomes the value of a key `results` beside it.
/// Error kIo naming the file.
Result<void> write_results(const std::filesystem::path& file, nlohmann::json results);

/// Makes a number for JSON; null if it is not finite.
nlohmann::json number_or_null(double value);

/// Returns what floating-point results may depend on, such as "x86_64, AMD EPYC 7B13".
std::string processor();

/// Returns what this program was built from and how, such as "Jostle 0.9, GCC 12.2.0, Release, 23b3b47f0f90".
std::string build();

}  // namespace jostle::common
