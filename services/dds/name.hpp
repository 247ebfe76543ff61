#pragma once
/// \file
/// Names on the wire: whose topic it is.

#include <string>

#include "idl/types/result.hpp"

namespace jostle::dds {

enum class Scope {
  kRobot,   ///< one robot's: in its namespace, if it has one
  kDomain,  ///< shared by all in the domain: the pool of workers
};

/// Reads a ROS 2 namespace, such as "left" or "/lab/left": words of letters, digits and single
/// underscores that begin with no digit. Gives it without the first slash; "" is none.
/// Error kInvalidArgument: says got and wanted; also for `pool` and `doctor`, which are everybody's.
Result<std::string> parse_namespace(const std::string& text);

/// "rt/joint_states" in "left": "rt/left/joint_states", as ROS 2 has /left/joint_states.
std::string in_namespace(const std::string& space, const std::string& topic);

}  // namespace jostle::dds
