#pragma once
/// \file
/// What a topic's writer offered, as rosbag2 writes it down.

#include <string>

#include "idl/types/qos.hpp"

namespace jostle::bags {

/// Writes one profile as YAML, with the numbers of rmw's enumerations as Humble writes them. What
/// ROS has no word for (`retained`, `instances`) has keys of its own, which its tools skip.
std::string qos_text(const Qos& qos);

/// Reads one profile or several, and returns what all of them offer. Names as later versions write them are known,
/// too. What is missing or cannot be read is the default.
Qos parse_qos(const std::string& text);

}  // namespace jostle::bags
