#pragma once
/// \file
/// What a run leaves behind: a summary, result.json and a picture.

#include "idl/types/result.hpp"
#include "services/task/run/options.hpp"
#include "services/wire/dds/topics.hpp"

namespace jostle::task {

/// Prints the summary to standard output and writes the files asked for, also of a task that was cancelled or broke,
/// which has come to something; of one that never began there is only an error to print. The picture shows the
/// execution, or the plan where nothing was executed.
Result<void> leave_report(const RunOptions& options, const jostle_msgs::msg::GoalResult& result);

/// Returns what there is to say of a task that was cancelled, broke or never began; empty for any other.
std::string error_of(const jostle_msgs::msg::GoalResult& result);

/// Returns what a program that asked for the goal exits with.
int exit_code_of(const jostle_msgs::msg::GoalResult& result);

}  // namespace jostle::task
