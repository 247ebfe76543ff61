#pragma once
/// \file
/// What a run leaves behind: a summary, result.json and a picture.

#include "idl/types/result.hpp"
#include "services/task/run/options.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::task {

/// Prints the summary to standard output and writes the files asked for. The
/// picture shows the execution, or the plan where nothing was executed.
Result<void> leave_report(const RunOptions& options, const jostle_msgs::msg::GoalResult& result);

}  // namespace jostle::task
