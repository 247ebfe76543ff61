#pragma once
/// \file
/// Running a study: cases side by side, each kept at once, until all are done or somebody asks to stop.

#include <functional>
#include <stop_token>
#include <string>

#include "services/common/results/journal.hpp"
#include "services/studies/experiment/study.hpp"

namespace jostle::studies {

struct StudyRunOptions {
  std::stop_token stop;
  common::Journal* journal = nullptr;  ///< where cases are kept and taken from; null: nowhere
  /// Called once, when it is known how many cases there are, and how many of them the journal has.
  std::function<void(std::size_t total, std::size_t found)> on_begin = [](std::size_t, std::size_t) {};
  /// Called after each case, from one thread at a time, with a few words on it.
  std::function<void(const std::string& news)> on_case = [](const std::string&) {};
  /// Called, from one thread at a time, when something is wrong that does not end the study.
  std::function<void(const std::string& trouble)> on_trouble = [](const std::string&) {};
};

/// What became of a study.
struct StudyEnd {
  StudyReport report;  ///< its JSON has `partial`, if not all cases were run
  std::size_t done = 0, total = 0;
  std::size_t found = 0;   ///< of those done: taken from the journal
  std::size_t broken = 0;  ///< of those done: cases in which parts of the system failed; the journal does not have them
  bool complete() const { return done == total; }
};

/// Runs a study whose options were parsed. After a stop request the cases under way are not counted.
/// Errors   those of Study::prepare
Result<StudyEnd> run_study(Study& study, const StudyRunOptions& options);

/// Returns what the cases of a study depend on, for its journal: the study's files, its settings, the build, the
/// machine. Errors   those of study_files
Result<nlohmann::json> origin_of(const std::string& name, const Study& study);

}  // namespace jostle::studies
