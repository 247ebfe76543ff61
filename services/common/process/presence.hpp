#pragma once
/// \file
/// Whether others on the network still know this process.

#include <chrono>
#include <set>
#include <stop_token>
#include <string>

namespace jostle::common {

/// Returns the IPv4 addresses of the network interfaces that are up and have their cable in; loopback
/// is none of them.
std::set<std::string> reachable_addresses();

/// Returns once others may have lost sight of this process, and says why; empty after a stop
/// request. That is when
///   there is an address that was not there all the time since `known`: the network came
///   up, or a cable was out and is in again
///   this process did not run for longer than `pause`: it was stopped, or the machine slept
/// Looks five times a second.
std::string wait_until_forgotten(std::set<std::string> known, std::chrono::milliseconds pause, std::stop_token stop);

}  // namespace jostle::common
