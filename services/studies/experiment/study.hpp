#pragma once
/// \file
/// Study: one of the thesis's figures or tables, made again.

#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "idl/types/result.hpp"
#include "services/common/charts/plot.hpp"

namespace jostle::studies {

/// What the command line may change of a study. A study refuses what it does not have.
struct StudyOptions {
  int jobs = 1;                                                  ///< runs at a time
  std::optional<std::pair<std::uint64_t, std::uint64_t>> seeds;  ///< first and last
  std::vector<std::string> levels, controllers;                  ///< grasping
  std::optional<std::chrono::milliseconds> timeout;              ///< that of one run
  std::vector<std::string> models;                               ///< coarse models, or predictors
  std::optional<int> samples;
  std::stop_token stop;
  /// Called from one thread at a time, with a line for people.
  std::function<void(const std::string& line)> on_progress;
};

struct StudyReport {
  std::string table;                  ///< for people
  nlohmann::json json;                ///< all numbers
  std::vector<common::Panel> panels;  ///< the figure; empty for a table
  bool broken = false;                ///< parts of the system failed
};

class Study {
 public:
  virtual ~Study() = default;

  virtual const std::string& title() const = 0;

  /// Errors   kInvalidArgument  an option this study does not have
  ///          kCancelled        a stop was requested
  virtual Result<StudyReport> run(const StudyOptions& options) = 0;
};

/// Loads a study by its `name`, such as "fig-3.5": a file of the data folder experiments/ with the key `study`.
/// Errors   kNotFound  no such file; kInvalidArgument, naming file, line and field
Result<std::unique_ptr<Study>> load_study(const std::string& name);

/// Returns the files that decide a study's numbers, by name: its own, and that of its parameters.
/// Error kIo naming one that cannot be read.
Result<std::map<std::string, std::string>> study_files(const std::string& name);

/// Returns names and titles of all studies there are, sorted by name.
std::vector<std::pair<std::string, std::string>> list_studies();

/// Runs `count` jobs, `at_a_time` of them; ends early when `stop` is requested. `job` is
/// called with 0 … count - 1 from several threads.
void run_side_by_side(std::size_t count, int at_a_time, std::stop_token stop,
                      const std::function<void(std::size_t)>& job);

}  // namespace jostle::studies
