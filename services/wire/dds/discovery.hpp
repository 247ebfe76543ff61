#pragma once
/// \file
/// Discovery: how processes of a DDS domain find each other.

#include <cstdint>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::wire {

/// Where a discovery server listens unless told otherwise; ROS 2's port too.
inline constexpr std::uint16_t kServerPort = 11811;

struct Discovery {
  enum class Mode {
    kMulticast,  ///< everybody on a network that passes multicast, and the hosts listed
    kPeers,      ///< the hosts listed, each listing the others; this host always
    kServer,     ///< through discovery servers, which introduce processes and carry no data
    kLocalhost,  ///< this host, and nobody else
  };
  struct Host {
    std::string address;     ///< IPv4; empty where a list of servers leaves a place out
    std::uint16_t port = 0;  ///< that of a server
    bool operator==(const Host&) const = default;
  };

  Mode mode = Mode::kMulticast;
  std::vector<Host> hosts;
};

/// Returns the IPv4 address of a host, given as an address or by a name. Error kNotFound.
Result<std::string> resolve(const std::string& host);

/// Reads
///
///   multicast
///   multicast+peers:HOST[,HOST…]
///   peers:HOST[,HOST…]
///   server:HOST[:PORT][,HOST[:PORT]…]   the n-th is the one with --id n, from 0; a place may be empty
///   localhost
///
/// HOST is an IPv4 address or a name that resolves to one; names are looked up here.
/// Errors   kInvalidArgument  not of this form
///          kNotFound         a name that does not resolve
Result<Discovery> parse_discovery(const std::string& text);

}  // namespace jostle::wire
