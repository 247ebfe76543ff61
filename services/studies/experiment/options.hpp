#pragma once
/// \file
/// Options that several studies have.

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "idl/types/result.hpp"

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

}  // namespace jostle::studies
