#pragma once
/// \file
/// What discovery and transport over UDP need.

#include <vector>

#include "services/doctor/check.hpp"

namespace jostle::services {

/// Whether multicast has a route, and whether a datagram that is sent to the
/// group of Fast DDS's discovery comes back, on the loopback and on the
/// interface of the route. Sends for real, to a port of its own.
std::vector<Check> check_multicast();

/// The kernel's limit on receive buffers against what large samples need.
Check check_udp_buffers();

/// ROS_DOMAIN_ID, where set, is a domain.
Check check_domain();

}  // namespace jostle::services
