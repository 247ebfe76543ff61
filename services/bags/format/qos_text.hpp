#pragma once
/// \file
/// What a topic's writer offered, as rosbag2 writes it down.

#include <string>

#include "idl/types/qos.hpp"

namespace jostle::bags {

/// One profile as YAML, with the numbers of rmw's enumerations as Humble writes them. What
/// ROS has no word for (`retained`, `instances`) has keys of its own, which its tools skip.
std::string qos_text(const Qos& qos);

/// Of several profiles what all of them offer; names as later versions write them are known,
/// too. What is missing or cannot be read is the default.
Qos parse_qos(const std::string& text);

}  // namespace jostle::bags
