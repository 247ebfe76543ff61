#pragma once
/// \file
/// The doctor that asks: what works between this host and another one, `jostle doctor --peer HOST`.

#include <string>
#include <vector>

#include "services/tools/doctor/check.hpp"
#include "services/wire/dds/participant.hpp"

namespace jostle::tools {

struct PeerOptions {
  std::string host;  ///< where `jostle doctor --listen` runs
  int port = 0;      ///< TCP port of its door
};

/// Checks, in this order, as far as it makes sense to go on:
///
///   peer               the name resolves, the other doctor answers
///   version, domain    both have the same; so with discovery and identity
///   clock              how far the other one's is ahead
///   multicast          datagrams to the discovery group come through, both ways   (discovery by multicast)
///   UDP                datagrams to a port of the domain, small and in fragments, both ways
///   discovery server   answers                                                     (discovery by server)
///   participants       find each other, and how fast
///   samples            small ones and such of 1 MiB come back
///
/// and what the other doctor found on its own machine, named "HOST: …".
///
/// Time  seconds; half a minute where nothing gets through.
std::vector<Check> check_peer(const PeerOptions& peer, const wire::ParticipantOptions& options);

/// Checks whether discovery servers answer. In other modes of discovery there is nothing to check.
std::vector<Check> check_discovery_servers(const wire::Participant& participant);

}  // namespace jostle::tools
