#pragma once
/// \file
/// Studies as a user starts them: options in, a report out.

#include <CLI/CLI.hpp>
#include <algorithm>
#include <stdexcept>
#include <string>
#include <vector>

#include "services/studies/experiment/study_run.hpp"

namespace jostle::tests {

/// Gives a study its options, such as {"--seeds", "1-2"}. Throws CLI::ParseError for those it does not have.
inline void set_options(studies::Study& study, std::vector<std::string> words) {
  CLI::App app;
  study.add_options(app);
  std::ranges::reverse(words);  // as CLI11 wants them
  app.parse(words);
}

/// Runs all cases. Throws if the study cannot begin.
inline studies::StudyEnd finished(studies::Study& study, const studies::StudyRunOptions& options = {}) {
  auto end_result = studies::run_study(study, options);
  if (!end_result) throw std::runtime_error(end_result.error().message);
  return std::move(end_result).value();
}

/// What run_study refuses, in its words.
inline std::string refusal(studies::Study& study) {
  auto end_result = studies::run_study(study, {});
  return end_result ? "" : end_result.error().message;
}

}  // namespace jostle::tests
