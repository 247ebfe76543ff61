#pragma once
/// \file
/// DomainClaim: keeps a second process of the same role off a domain. Two worlds on one domain
/// would speak into each other's topics.

#include <chrono>
#include <string>

#include "idl/types/result.hpp"

namespace jostle::common {

/// A role that only one process of a machine may have on a DDS domain, or in a namespace of it. Held
/// until it is destroyed or the process ends, however it ends.
///
/// It is a bound socket without a file: there is nothing to clean up, and it reaches
/// exactly as far as loopback traffic does, the network namespace.
class DomainClaim {
 public:
  /// Takes a role. `role`: a few words; `space`: the namespace it is in, "" for none. Waits up to `patience` for a
  /// predecessor that is just ending. Error kUnavailable if another process has the role.
  static Result<DomainClaim> take(const std::string& role, int domain, std::chrono::milliseconds patience,
                                  const std::string& space = "");

  DomainClaim(DomainClaim&& other) noexcept;
  DomainClaim& operator=(DomainClaim&& other) noexcept;
  ~DomainClaim();

 private:
  explicit DomainClaim(int socket) : socket_(socket) {}

  int socket_;
};

/// A domain that claim_some_domain() has given to nobody else on this machine.
struct OwnDomain {
  int domain = 0;
  DomainClaim claim;  ///< the domain is ours while it is held
};

/// Claims a domain from 1 to 100. Beyond, a domain's UDP ports are among those that Linux gives to sockets that
/// ask for any (from 32768), and participants whose discovery port is somebody else's find nobody.
/// Error kUnavailable if all are taken.
Result<OwnDomain> claim_some_domain();

}  // namespace jostle::common
