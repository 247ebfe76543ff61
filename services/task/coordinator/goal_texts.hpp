#pragma once
/// \file
/// The texts of a goal that came over the wire.

#include <string_view>

#include "idl/msg/task.h"
#include "idl/types/result.hpp"

namespace jostle::task {

/// Whether its texts are short enough to be parsed: parsers take hundreds of times as many bytes.
/// Error kInvalidArgument: says field, got, wanted.
Result<void> check_sizes(const jostle_msgs::msg::Goal& goal);

/// Fills in what a goal leaves out, so that it says everything that decides its run: the planning scene is the
/// execution scene, the controller the first that can do the task, its parameters are changed by those given.
/// `kind`: the task's kind that is wanted.
/// Errors   those of the texts; the message names the field
Result<jostle_msgs::msg::Goal> complete(jostle_msgs::msg::Goal goal, std::string_view kind);

}  // namespace jostle::task
