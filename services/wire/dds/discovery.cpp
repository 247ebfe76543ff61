#include "services/wire/dds/discovery.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netdb.h>

#include <algorithm>
#include <optional>
#include <ranges>
#include <string_view>

#include "idl/types/number.hpp"

namespace jostle::wire {
namespace {

Error malformed(const std::string& text, const std::string& why) {
  return {
      Code::kInvalidArgument,
      fmt::format("discovery: got '{}', wanted multicast, peers:HOST[,HOST...], server:HOST[:PORT] or localhost: {}",
                  text, why)};
}

std::optional<Discovery::Mode> mode_of(std::string_view word) {
  if (word == "multicast+peers") return Discovery::Mode::kMulticast;
  if (word == "peers") return Discovery::Mode::kPeers;
  if (word == "server") return Discovery::Mode::kServer;
  return {};
}

}  // namespace

Result<std::string> resolve(const std::string& host) {
  const addrinfo hints{.ai_family = AF_INET, .ai_socktype = SOCK_DGRAM};
  addrinfo* found = nullptr;
  if (const int code = getaddrinfo(host.c_str(), nullptr, &hints, &found); code != 0) {
    return Error{Code::kNotFound, fmt::format("host '{}': {}; wanted an IPv4 address or a name that "
                                              "resolves to one",
                                              host, gai_strerror(code))};
  }
  char text[INET_ADDRSTRLEN] = "";
  inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(found->ai_addr)->sin_addr, text, sizeof text);
  freeaddrinfo(found);
  return std::string(text);
}

Result<Discovery> parse_discovery(const std::string& text) {
  if (text == "multicast") return Discovery{};
  if (text == "localhost") return Discovery{.mode = Discovery::Mode::kLocalhost};
  const std::size_t colon = text.find(':');
  const auto mode = colon == std::string::npos ? std::nullopt : mode_of(std::string_view(text).substr(0, colon));
  if (!mode) return malformed(text, "no such way");
  Discovery discovery{.mode = *mode};
  const bool with_port = discovery.mode == Discovery::Mode::kServer;
  for (const auto part : std::string_view(text).substr(colon + 1) | std::views::split(',')) {
    std::string host(part.begin(), part.end());
    if (with_port && host.empty()) {
      discovery.hosts.push_back({});
      continue;
    }
    std::uint16_t port = with_port ? kServerPort : std::uint16_t{0};
    if (const std::size_t at = host.find(':'); at != std::string::npos) {
      if (!with_port) return malformed(text, fmt::format("'{}' has a port; peers need none", host));
      const auto given = parse_whole<std::uint16_t>(std::string_view(host).substr(at + 1), 1, UINT16_MAX);
      if (!given) return malformed(text, fmt::format("'{}' has no port from 1 to 65535", host));
      port = *given;
      host.erase(at);
    }
    if (host.empty()) return malformed(text, "a host is empty");
    auto address_result = resolve(host);
    if (!address_result) return Error{address_result.error().code, "discovery: " + address_result.error().message};
    discovery.hosts.push_back({.address = std::move(address_result).value(), .port = port});
  }
  if (std::ranges::all_of(discovery.hosts, &std::string::empty, &Discovery::Host::address))
    return malformed(text, "a host is empty");
  return discovery;
}

}  // namespace jostle::wire
