#pragma once
/// \file
/// What discovery and transport over UDP need.

#include <optional>
#include <vector>

#include "services/tools/doctor/check.hpp"

namespace jostle::tools {

/// Checks that this machine has IPv4 addresses, and how far they reach.
Check check_addresses();

/// Whether processes find each other by multicast here; by all else they need none.
bool finds_by_multicast();

/// Checks whether multicast has a route, and whether a datagram that is sent to the
/// group of Fast DDS's discovery comes back, on the loopback and on the
/// interface of the route. Sends for real, to a port of its own.
std::vector<Check> check_multicast();

/// Checks the kernel's limit on receive buffers against what large samples need.
Check check_udp_buffers();

/// Checks that the file of transports and QoS can be used. Call it before any participant is made.
Check check_profiles();

/// Checks that what --domain or ROS_DOMAIN_ID says is a domain.
Check check_domain(std::optional<int> wanted);

}  // namespace jostle::tools
