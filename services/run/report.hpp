#pragma once
/// \file
/// What a run leaves behind: a summary, result.json and a picture.

#include "idl/types/result.hpp"
#include "services/dds/topics.hpp"
#include "services/run/options.hpp"

namespace jostle::services {

/// Prints the summary to standard output and writes the files asked for. The
/// picture shows the execution, or the plan where nothing was executed.
Result<void> leave_report(const RunOptions& options, const jostle_msgs::msg::GoalResult& result);

}  // namespace jostle::services
