#include "services/common/process/domain_claim.hpp"

#include <fmt/format.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstring>
#include <thread>
#include <utility>

namespace jostle::common {
namespace {

constexpr std::chrono::milliseconds kRetry{20};
constexpr int kOwnDomains = 100;

}  // namespace

Result<DomainClaim> DomainClaim::take(const std::string& role, int domain, std::chrono::milliseconds patience,
                                      const std::string& space) {
  const int handle = socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const auto failed = [&](const char* what) {
    return Error{Code::kUnavailable, fmt::format("domain {}: the claim to be its only {} could not be made: {}: {}",
                                                 domain, role, what, std::strerror(errno))};
  };
  if (handle < 0) return failed("socket");
  DomainClaim claim(handle);
  sockaddr_un address{.sun_family = AF_UNIX, .sun_path = {}};
  // A leading zero: a name in the kernel, not a file.
  const std::string name = fmt::format("jostle/{}/{}{}{}", domain, role, space.empty() ? "" : " of ", space);
  name.copy(address.sun_path + 1, sizeof(address.sun_path) - 1);
  const auto length = static_cast<socklen_t>(offsetof(sockaddr_un, sun_path) + 1 + name.size());
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (bind(handle, reinterpret_cast<const sockaddr*>(&address), length) != 0) {
    if (errno != EADDRINUSE) return failed("bind");
    if (std::chrono::steady_clock::now() >= deadline) {
      return Error{Code::kUnavailable,
                   fmt::format("domain {}: got another {} on this machine{}, wanted none; set ROS_DOMAIN_ID "
                               "to a free one, or --namespace to one of its own",
                               domain, role, space.empty() ? "" : " in namespace " + space)};
    }
    std::this_thread::sleep_for(kRetry);
  }
  return claim;
}

DomainClaim::DomainClaim(DomainClaim&& other) noexcept : socket_(std::exchange(other.socket_, -1)) {}

DomainClaim& DomainClaim::operator=(DomainClaim&& other) noexcept {
  std::swap(socket_, other.socket_);
  return *this;
}

DomainClaim::~DomainClaim() {
  if (socket_ >= 0) close(socket_);
}

Result<OwnDomain> claim_some_domain() {
  for (int i = 0; i < kOwnDomains; ++i) {
    const int candidate = 1 + (getpid() + i) % kOwnDomains;
    auto claim_result = DomainClaim::take("experiment", candidate, std::chrono::milliseconds(0));
    if (claim_result) return OwnDomain{candidate, std::move(claim_result).value()};
  }
  return Error{Code::kUnavailable,
               fmt::format("DDS domains 1 to {}: all in use by tests and benchmarks of this machine; "
                           "wanted one, give it with --domain",
                           kOwnDomains)};
}

}  // namespace jostle::common
