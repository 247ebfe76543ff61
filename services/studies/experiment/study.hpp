#pragma once
/// \file
/// Study: one of the thesis's figures or tables, made again.

#include <cstdint>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <stop_token>
#include <string>
#include <utility>
#include <vector>

#include "idl/text/yaml_fields.hpp"
#include "idl/types/result.hpp"
#include "services/common/charts/plot.hpp"

namespace CLI {
class App;
}

namespace jostle::studies {

/// What a list of studies says of one.
struct StudyAbout {
  std::string title;
  std::string purpose;  ///< one sentence
  std::string takes;    ///< how long all of it takes, and on what, such as "15 min on two cores"
};

struct StudyReport {
  std::string table;    ///< for people
  nlohmann::json json;  ///< all numbers
};

/// A Study is a list of cases, which are run one by one and kept one by one, and a report of those that have been run.
/// A record is what is kept of a case: a JSON object with all that the report needs of it. Where a part of the system
/// failed instead, it is {"error": "…"}.
///
/// Threads  run_case() is called from as many at a time as at_a_time() says, the rest from one.
class Study {
 public:
  explicit Study(StudyAbout about) : about_(std::move(about)) {}
  virtual ~Study() = default;

  const StudyAbout& about() const { return about_; }
  const std::string& title() const { return about_.title; }

  /// Adds the options that this study has, and no others.
  virtual void add_options(CLI::App& app) = 0;

  /// Makes the cases ready, after the options were parsed, and returns their names in the report's order. A name says
  /// all that makes the case another than those beside it, with other options as well.
  /// Errors   kInvalidArgument  an option; names it
  virtual Result<std::vector<std::string>> prepare() = 0;

  /// What options have changed for all cases alike, for a record to be of use again.
  virtual nlohmann::json settings() const = 0;

  /// How many cases run side by side; 1 where times are measured.
  virtual int at_a_time() const { return 1; }

  /// Runs a case. Errors: those of the parts of the system; a task that fails or runs out of time is a record.
  virtual Result<nlohmann::json> run_case(std::size_t index, std::stop_token stop) = 0;

  /// Says in a few words what came of a case.
  virtual std::string news_of(const nlohmann::json& record) const = 0;

  /// Makes the report of [cases] records, those that were not run being null.
  virtual StudyReport report(const std::vector<nlohmann::json>& records) const = 0;

  virtual bool has_figure() const { return false; }

  /// Makes the figure of a report's numbers, which may come from a file. May throw what nlohmann::json does
  /// if they are those of another study.
  virtual std::vector<common::Panel> figure(const nlohmann::json& report) const;

 private:
  StudyAbout about_;
};

/// Reads what a file of experiments/ says of its study to people.
StudyAbout read_about(yaml::Fields& fields);

/// Loads a study by its `name`, such as "fig-3.5": a file of the data folder experiments/ with the key `study`.
/// Errors   kNotFound  no such file; kInvalidArgument, naming file, line and field
Result<std::unique_ptr<Study>> load_study(const std::string& name);

/// Returns the files that decide a study's numbers, by name: its own, and that of its parameters.
/// Error kIo naming one that cannot be read.
Result<std::map<std::string, std::string>> study_files(const std::string& name);

/// Loads all studies there are, sorted by name. A file that cannot be loaded is left out.
std::vector<std::pair<std::string, std::unique_ptr<Study>>> load_studies();

/// Parses seeds: "1-10", or "7" for that one alone.
/// Error kInvalidArgument
Result<std::pair<std::uint64_t, std::uint64_t>> parse_seeds(const std::string& text);

}  // namespace jostle::studies
