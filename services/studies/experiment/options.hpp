#pragma once
/// \file
/// Options that several studies have, and parts of their files.

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "idl/text/yaml_fields.hpp"
#include "idl/types/result.hpp"
#include "services/task/config/parameters.hpp"

namespace CLI {
class App;
}

namespace jostle::studies {

/// Scenes of a study, by seed: `--seeds 1-10`.
class SeedsOption {
 public:
  void add_to(CLI::App& app, std::uint64_t first, std::uint64_t last);
  /// Replaces the study's seeds, if the option was given. Error kInvalidArgument
  Result<void> apply(std::uint64_t& first, std::uint64_t& last) const;

 private:
  std::string text_;
};

/// How long one run may take: `--timeout 60`.
void add_timeout_option(CLI::App& app, std::optional<double>& seconds);

/// How many cases run at a time: `--jobs 2`; one for each processor by default.
void add_jobs_option(CLI::App& app, int& jobs, const std::string& what = "Runs at a time");

/// Reads the seeds of a study's file: `seeds: {first: 1, last: 10}`.
void read_seeds(yaml::Fields& fields, std::uint64_t& first, std::uint64_t& last);

/// Loads the parameters that a study's file, `origin`, names by a file beside it. Errors   those of load_parameters
Result<task::Parameters> parameters_beside(const std::string& origin, const std::string& file);

/// Checks that there are methods, and that each is a controller. Error kInvalidArgument naming `where`
Result<void> check_methods(const std::vector<std::string>& methods, const std::string& where);

}  // namespace jostle::studies
