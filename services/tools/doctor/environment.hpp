#pragma once
/// \file
/// What the environment's variables mean for this machine, ROS 2's as well as Jostle's.

#include <vector>

#include "services/tools/doctor/check.hpp"
#include "services/wire/dds/participant.hpp"

namespace jostle::tools {

/// Checks how processes find each other, and what decided that; and says of each variable that is set what it does
/// here: it is in force, another one overrules it, it is malformed, nobody here reads it.
std::vector<Check> check_environment();

/// Joins the domain as any program would; in discovery by servers it checks these, too.
std::vector<Check> check_joining(const wire::ParticipantOptions& options);

}  // namespace jostle::tools
