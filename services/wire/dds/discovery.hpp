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
    kMulticast,  ///< everybody on a network that passes multicast
    kPeers,      ///< the hosts listed, each listing the others; this host always
    kServer,     ///< through discovery servers, which introduce processes and carry no data
  };
  struct Host {
    std::string address;     ///< IPv4
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
///   peers:HOST[,HOST…]
///   server:HOST[:PORT][,HOST[:PORT]…]   the n-th is the one with --id n, from 0
///
/// HOST is an IPv4 address or a name that resolves to one; names are looked up here.
/// Errors   kInvalidArgument  not of this form
///          kNotFound         a name that does not resolve
Result<Discovery> parse_discovery(const std::string& text);

}  // namespace jostle::wire
