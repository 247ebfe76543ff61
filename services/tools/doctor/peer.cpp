#include "services/tools/doctor/peer.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "idl/types/time.hpp"
#include "services/common/charts/statistics.hpp"
#include "services/common/process/domain.hpp"
#include "services/common/process/environment.hpp"
#include "services/tools/doctor/echo.hpp"
#include "services/tools/doctor/facts.hpp"
#include "services/tools/doctor/line.hpp"
#include "services/wire/dds/profiles.hpp"

namespace jostle::tools {
namespace {

using nlohmann::json;
using Clock = std::chrono::steady_clock;
using wire::Discovery;

constexpr std::chrono::seconds kConnect{4};         // the kernel gives up looking for a host after 3 s
constexpr std::chrono::milliseconds kPassage{500};  // of a datagram; a network takes a few milliseconds
constexpr int kCopies = 3;                          // of a datagram: one may get lost
constexpr std::chrono::seconds kSettling{3};        // six announcements
constexpr std::chrono::seconds kMeeting{
    10};                           // three of the middleware's own repeats: what did not meet by then will not
constexpr double kExpected = 2.0;  // s; announcements go out twice a second
constexpr int kClockTrips = 20;
constexpr double kClockTolerance = 5e-3;  // s; half of the period of a 100 Hz stream
constexpr int kSmall = 50, kLarge = 5;    // samples
constexpr std::size_t kSmallBytes = 100, kLargeBytes = 1 << 20;
constexpr std::size_t kFragmented =
    60'000;  // bytes; the largest packets of DDS are 65 500, in 45 fragments of Ethernet
constexpr std::chrono::seconds kSample{5};
constexpr double kSlow = 0.5;  // s there and back for 1 MiB; 14 ms over a link of 1 Gbit/s

struct Pair {
  Line& line;
  Facts ours, theirs;
  wire::Discovery discovery;
  std::string host;     // as the user said it
  in_addr there, here;  // addresses that the two use for each other

  std::string both() const { return fmt::format("{},{}", to_string(here), to_string(there)); }
};

// --- what both should have in common ------------------------------------------

Check check_same(const std::string& name, const std::string& ours, const std::string& theirs,
                 const std::string& remedy) {
  if (ours == theirs) return {name, Verdict::kOk, ours.empty() ? "none" : ours, ""};
  const auto shown = [](const std::string& text) { return text.empty() ? std::string("none") : text; };
  return {name, Verdict::kFail, fmt::format("here {}, there {}", shown(ours), shown(theirs)), remedy};
}

Check check_version(const Pair& pair) {
  const auto shown = [](const Facts& facts) { return fmt::format("{}, wire types {:.8}", facts.version, facts.types); };
  return check_same("version", shown(pair.ours), shown(pair.theirs), "install the same version of Jostle on both");
}

Check check_same_domain(const Pair& pair) {
  return check_same("domain", std::to_string(pair.ours.domain), std::to_string(pair.theirs.domain),
                    "set ROS_DOMAIN_ID (or --domain) to the same number on both");
}

Check check_discovery(const Pair& pair) {
  const auto way = [](const std::string& text) { return text.substr(0, text.find(':')); };
  if (way(pair.ours.discovery) != way(pair.theirs.discovery)) {
    return check_same("discovery", pair.ours.discovery, pair.theirs.discovery,
                      "give both the same --discovery (JOSTLE_DISCOVERY)");
  }
  const auto lists = [](const std::string& text, in_addr address) {
    const auto discovery = wire::parse_discovery(text);
    return discovery &&
           std::ranges::any_of(discovery->hosts, [&](const auto& host) { return host.address == to_string(address); });
  };
  if (pair.discovery.mode == wire::Discovery::Mode::kPeers && !lists(pair.ours.discovery, pair.there)) {
    return {"discovery", Verdict::kFail,
            fmt::format("{} here does not list {}", pair.ours.discovery, to_string(pair.there)),
            fmt::format("--discovery peers:{} on both", pair.both())};
  }
  if (pair.discovery.mode == wire::Discovery::Mode::kPeers && !lists(pair.theirs.discovery, pair.here)) {
    return {
        "discovery", Verdict::kWarn,
        fmt::format("{} there does not list {}", pair.theirs.discovery, to_string(pair.here)),
        fmt::format("--discovery peers:{} on both; with one list alone hosts may take seconds to meet", pair.both())};
  }
  if (pair.discovery.mode == wire::Discovery::Mode::kServer && pair.ours.discovery != pair.theirs.discovery) {
    return {"discovery", Verdict::kWarn, fmt::format("here {}, there {}", pair.ours.discovery, pair.theirs.discovery),
            "name the same servers, in the same order, on both"};
  }
  return {"discovery", Verdict::kOk, pair.ours.discovery, ""};
}

Check check_identities(const Pair& pair) {
  const auto &ours = pair.ours, &theirs = pair.theirs;
  if (ours.identity.empty() != theirs.identity.empty()) {
    return check_same("identity", ours.identity, theirs.identity,
                      "protected and unprotected programs do not see each other: give both --secure, or neither");
  }
  if (ours.authority != theirs.authority) {
    return {"identity", Verdict::kFail,
            fmt::format("here {}, there {}, of different keystores", ours.identity, theirs.identity),
            "issue both from one keystore: jostle keys issue"};
  }
  if (ours.identity.empty()) return {"identity", Verdict::kOk, "both are unprotected", ""};
  return {"identity", Verdict::kOk, fmt::format("here {}, there {}, of one keystore", ours.identity, theirs.identity),
          ""};
}

// The exchange with the least delay says most: the truth is at most half of that away.
Check check_clock(const Pair& pair) {
  double ahead = 0, delay = INFINITY;  // s
  for (int i = 0; i < kClockTrips; ++i) {
    const std::int64_t asked = wall_clock_ns();
    const auto start = Clock::now();
    const auto answer = pair.line.ask({{"ask", "time"}});
    const double took = seconds(Clock::now() - start);
    if (!answer || !answer->contains("ns") || took >= delay) continue;
    delay = took;
    ahead = 1e-9 * static_cast<double>((*answer)["ns"].get<std::int64_t>() - asked) - took / 2;
  }
  if (!std::isfinite(delay)) return {"clock", Verdict::kFail, "the other doctor went silent", "start it again"};
  Check check{.name = "clock",
              .finding = fmt::format("{} is {:.2f} ms {}, give or take {:.2f} ms", pair.host, 1e3 * std::abs(ahead),
                                     ahead < 0 ? "behind" : "ahead", 1e3 * delay / 2)};
  if (std::abs(ahead) > kClockTolerance + delay / 2) {
    check.verdict = Verdict::kWarn;
    check.remedy =
        "run chrony (or systemd-timesyncd) on both: recordings and timelines of the two are apart by that much";
  }
  return check;
}

// --- datagrams ----------------------------------------------------------------

json question(const char* what, bool multicast, std::size_t bytes) {
  return {
      {"ask", what}, {"multicast", multicast}, {"text", fmt::format("jostle doctor {}", getpid())}, {"size", bytes}};
}

std::string said_wrong(const Result<json>& answer) {
  if (!answer) return answer.error().message;
  return answer->value("error", "");
}

// Both: "" if one of some equal datagrams came through, else what happened.
std::string there(const Pair& pair, bool multicast, std::size_t bytes) {
  json asked = question("listen", multicast, bytes);
  const auto place = pair.line.ask(asked);
  if (const std::string problem = said_wrong(place); !problem.empty()) return problem;
  const in_addr to = multicast ? in_addr{inet_addr(kGroup)} : pair.there;
  for (int i = 0; i < kCopies; ++i) {
    const auto ok = send_datagram(test_datagram(asked["text"], bytes), to, place->value("port", 0),
                                  multicast ? std::optional(pair.here) : std::nullopt);
    if (!ok) return ok.error().message;
  }
  asked["ask"] = "heard";
  const auto answer = pair.line.ask(asked);
  if (const std::string problem = said_wrong(answer); !problem.empty()) return problem;
  return answer->value("heard", false) ? "" : "sent, not received";
}

std::string back(const Pair& pair, bool multicast, std::size_t bytes) {
  const auto ear_result = multicast ? Ear::open(common::multicast_port(pair.ours.domain), pair.here)
                                    : Ear::open_in_domain(pair.ours.domain);
  if (!ear_result) return ear_result.error().message;
  json asked = question("send", multicast, bytes);
  asked["port"] = ear_result->port();
  for (int i = 0; i < kCopies; ++i) {
    if (const std::string problem = said_wrong(pair.line.ask(asked)); !problem.empty()) return problem;
  }
  return ear_result->hears(test_datagram(asked["text"], bytes), Clock::now() + kPassage) ? "" : "sent, not received";
}

Check check_passage(const Pair& pair, const std::string& name, bool multicast, std::size_t bytes,
                    const std::string& remedy) {
  const std::string to = there(pair, multicast, bytes), from = back(pair, multicast, bytes);
  if (to.empty() && from.empty()) return {name, Verdict::kOk, fmt::format("{} bytes, both ways", bytes), ""};
  const auto shown = [](const std::string& problem) { return problem.empty() ? "ok" : problem; };
  return {name, Verdict::kFail,
          fmt::format("{} bytes to {}: {}; from it: {}", bytes, pair.host, shown(to), shown(from)), remedy};
}

std::vector<Check> check_datagrams(const Pair& pair) {
  std::vector<Check> checks;
  const int first = common::multicast_port(pair.ours.domain);
  if (pair.discovery.mode == wire::Discovery::Mode::kMulticast) {
    checks.push_back(check_passage(
        pair, "multicast", true, kSmallBytes,
        fmt::format(
            "--discovery peers:{} on both, or server:HOST; or have switches and firewalls pass UDP to {} port {}",
            pair.both(), kGroup, first)));
  }
  checks.push_back(check_passage(pair, "UDP", false, kSmallBytes,
                                 fmt::format("let the firewalls of both pass UDP ports {} to {} (domain {})", first,
                                             first + common::kPortsPerDomain - 1, pair.ours.domain)));
  if (checks.back().verdict == Verdict::kOk) {
    checks.push_back(check_passage(
        pair, "UDP fragments", false, kFragmented,
        "let firewalls pass fragments of IP packets; the same MTU on both (ip link), the network's or less"));
  }
  return checks;
}

// --- DDS ----------------------------------------------------------------------

std::string remedy_for_strangers(const Pair& pair, bool found) {
  if (found)
    return "same version and profiles.xml on both; with --secure, identities whose role may say it (keystores from "
           "before this check: issue anew)";
  switch (pair.discovery.mode) {
    case wire::Discovery::Mode::kMulticast:
      return fmt::format("if multicast FAILs: --discovery peers:{} on both; else firewalls: UDP ports of the domain",
                         pair.both());
    case wire::Discovery::Mode::kPeers:
      return fmt::format("--discovery peers:{} on both; firewalls: UDP ports of the domain, see UDP", pair.both());
    case wire::Discovery::Mode::kLocalhost:
      return fmt::format("--discovery multicast, or peers:{}, on both: localhost hears nobody else", pair.both());
    case wire::Discovery::Mode::kServer:
      break;
  }
  return "start `jostle discovery-server` on the host that --discovery names; firewalls: its UDP port on that host";
}

Check check_samples(const Pair& pair, Caller& caller, const std::string& name, int count, std::size_t bytes,
                    const std::string& remedy) {
  std::vector<double> trips;  // s
  for (int i = 0; i < count; ++i) {
    const auto heard_before = pair.line.ask({{"ask", "echoes"}});
    const auto took = caller.call(bytes, Clock::now() + kSample);
    if (!took) {
      const auto heard = pair.line.ask({{"ask", "echoes"}});
      const bool arrived = heard && heard_before && heard->value("heard", 0) > heard_before->value("heard", 0);
      return {name, Verdict::kFail,
              fmt::format("{} of {} came back; the next one {}", i, count,
                          arrived ? "arrived there and got lost on the way back" : "did not arrive there"),
              remedy};
    }
    trips.push_back(seconds(*took));
  }
  Check check{.name = name,
              .finding = fmt::format("{} there and back, {:.2f} ms (median; at worst {:.2f})", count,
                                     1e3 * common::median(trips), 1e3 * *std::ranges::max_element(trips))};
  if (common::median(trips) > kSlow) {
    check.verdict = Verdict::kWarn;
    check.remedy = remedy;
  }
  return check;
}

std::vector<Check> check_dds(const Pair& pair, const wire::Participant& participant, Clock::time_point opened) {
  Caller caller(participant, fmt::format("{}-{}", pair.ours.host, getpid()));
  const bool met = caller.meet(Clock::now() + kMeeting);
  const double took = seconds(Clock::now() - opened);
  if (!met) {
    const auto others = participant.others();
    const bool found = std::ranges::count(others, "jostle_doctor") > 1;  // we are one
    return {
        {"participants", Verdict::kFail,
         fmt::format("{} in {} s{}", found ? "found each other, their topics did not match" : "did not find each other",
                     kMeeting.count(), participant.possible_cause()),
         remedy_for_strangers(pair, found)}};
  }
  caller.settle(Clock::now() + kSettling);  // whether answers come at all is for the samples to say
  std::vector<Check> checks{{"participants", Verdict::kOk, fmt::format("found each other in {:.2f} s", took), ""}};
  if (took > kExpected) {
    checks[0].verdict = Verdict::kWarn;
    checks[0].remedy =
        fmt::format("wanted at most {:.0f} s: packets get lost, or only one side lists the other", kExpected);
  }
  checks.push_back(
      check_samples(pair, caller, "small samples", kSmall, kSmallBytes, "firewalls: UDP ports of the domain, see UDP"));
  checks.push_back(check_samples(
      pair, caller, "samples of 1 MiB", kLarge, kLargeBytes,
      fmt::format("net.core.rmem_max and wmem_max of at least {} on both (sysctl.d/60-jostle.conf); see UDP fragments",
                  wire::socket_buffer())));
  return checks;
}

// Whether somebody refuses datagrams at that port: then no server is there.
bool is_refused(const wire::Discovery::Host& host) {
  const Socket probe(SOCK_DGRAM);
  const sockaddr_in there = endpoint({inet_addr(host.address.c_str())}, host.port);
  char byte = 0;
  if (connect(probe.get(), generic(there), sizeof there) != 0 || send(probe.get(), &byte, 1, 0) < 0) return true;
  return probe.readable(Clock::now() + kPassage) && recv(probe.get(), &byte, 1, 0) < 0;
}

}  // namespace

std::vector<Check> check_discovery_servers(const wire::Participant& participant) {
  const auto choice_result = common::choose_network();
  if (!choice_result) return {};
  const auto discovery = wire::parse_discovery(choice_result->discovery);
  if (!discovery || discovery->mode != wire::Discovery::Mode::kServer) return {};
  std::vector<Check> checks;
  for (const auto& host : discovery->hosts) {
    if (host.address.empty()) continue;
    const std::string place = fmt::format("{}:{}", host.address, host.port);
    Check check{.name = "discovery server", .finding = place};
    if (is_refused(host)) {
      check.verdict = Verdict::kFail;
      check.finding += ": nobody listens there";
      check.remedy = fmt::format(
          "start `jostle discovery-server` on {}, or systemctl enable --now jostle-discovery-server", host.address);
    }
    checks.push_back(check);
  }
  // Who answers is found as a participant, before anybody else.
  const auto deadline = Clock::now() + std::chrono::seconds(3);
  while (participant.others().size() < 2 && Clock::now() < deadline) std::this_thread::sleep_for(kPassage / 10);
  if (participant.others().size() < 2 && checks.front().verdict == Verdict::kOk) {
    checks.front() = {"discovery server", Verdict::kFail, checks.front().finding + ": no answer in 3 s",
                      "let its firewall pass that UDP port; `jostle doctor` there"};
  }
  return checks;
}

namespace {

// Throws what the JSON library throws at answers that are none.
std::vector<Check> examine(const PeerOptions& peer, const wire::ParticipantOptions& options) {
  const auto address_result = wire::resolve(peer.host);
  if (!address_result)
    return {{"peer", Verdict::kFail, address_result.error().message,
             "its address instead of its name, or a line in /etc/hosts"}};
  const in_addr there{inet_addr(address_result->c_str())};
  const std::string place = fmt::format("{} ({}), TCP port {}", peer.host, *address_result, peer.port);
  auto line_result = Line::connect(there, peer.port, kConnect);
  if (!line_result) {
    return {{"peer", Verdict::kFail, fmt::format("{}: {}", place, line_result.error().message),
             fmt::format("start `jostle doctor --listen` there; ping {}: cables, addresses (ip address), firewalls",
                         *address_result)}};
  }
  const auto silent = [&](const Error& error) {
    return Check{"peer", Verdict::kFail, fmt::format("{}: {}", place, error.message),
                 "start `jostle doctor --listen` there again, of the same version"};
  };
  const auto answer = line_result->ask({{"ask", "facts"}});
  if (!answer) return {silent(answer.error())};
  const auto theirs_result = parse_facts(*answer);
  if (!theirs_result) return {silent(theirs_result.error())};

  std::vector<Check> checks{{"peer", Verdict::kOk, fmt::format("{} is {}", place, theirs_result->host), ""}};
  for (Check check : theirs_result->checks) {
    check.name = fmt::format("{}: {}", peer.host, check.name);
    checks.push_back(std::move(check));
  }
  const auto opened = Clock::now();
  const auto participant_result = wire::Participant::open(options);
  if (!participant_result) {
    checks.push_back({"participant", Verdict::kFail, participant_result.error().message, "put that right first"});
    return checks;
  }
  const Pair pair{*line_result,
                  facts_of(participant_result->domain(), {}),
                  *theirs_result,
                  wire::parse_discovery(facts_of(participant_result->domain(), {}).discovery).value(),
                  peer.host,
                  there,
                  route_to(there).value_or(any_address())};
  const auto add = [&](const std::vector<Check>& more) { checks.insert(checks.end(), more.begin(), more.end()); };
  add({check_version(pair), check_same_domain(pair), check_discovery(pair), check_identities(pair), check_clock(pair)});
  if (pair.ours.domain != pair.theirs.domain) return checks;  // nothing meets, and ports differ
  add(check_discovery_servers(*participant_result));
  const auto met = check_dds(pair, *participant_result, opened);
  add(check_datagrams(pair));
  add(met);
  return checks;
}

}  // namespace

std::vector<Check> check_peer(const PeerOptions& peer, const wire::ParticipantOptions& options) {
  try {
    return examine(peer, options);
  } catch (const json::exception& problem) {
    return {{"peer", Verdict::kFail, fmt::format("{}, TCP port {}: {}", peer.host, peer.port, problem.what()),
             "see that `jostle doctor --listen` of the same version is there, and nothing else"}};
  }
}

}  // namespace jostle::tools
