#include "services/tools/doctor/facts.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <utility>

#include "idl/types/hash.hpp"
#include "services/common/process/environment.hpp"
#include "services/common/process/files.hpp"
#include "services/wire/security/identity.hpp"

namespace jostle::tools {
namespace {

constexpr std::size_t kLargestPayload = 65'507;  // bytes of a UDP datagram over IPv4
constexpr Verdict kVerdicts[] = {Verdict::kOk, Verdict::kWarn, Verdict::kFail};

// "" where what the environment says is malformed: no participant is made then.
std::string discovery_text() {
  const auto choice_result = common::choose_network();
  return choice_result ? choice_result->discovery : "";
}

}  // namespace

Facts facts_of(int domain, std::vector<Check> checks) {
  char host[256] = "?";
  gethostname(host, sizeof host - 1);
  Facts facts{.host = host,
              .version = JOSTLE_VERSION,
              .types = JOSTLE_WIRE_TYPES,
              .domain = domain,
              .discovery = discovery_text(),
              .checks = std::move(checks)};
  const std::string folder = common::environment("JOSTLE_SECURE");
  if (folder.empty()) return facts;
  // Good, or there would be no participant.
  const auto identity_result = wire::open_identity(folder);
  const auto authority_result = common::read_text(std::filesystem::path(folder) / "ca.pem");
  if (identity_result)
    facts.identity = fmt::format("{} ({})", identity_result->name, wire::to_string(identity_result->role));
  if (authority_result) facts.authority = to_string(hash_of(*authority_result));
  return facts;
}

nlohmann::json to_json(const std::vector<Check>& checks) {
  nlohmann::json list = nlohmann::json::array();
  for (const Check& check : checks) {
    list.push_back(
        {{"name", check.name}, {"verdict", word(check.verdict)}, {"finding", check.finding}, {"remedy", check.remedy}});
  }
  return list;
}

nlohmann::json to_json(const Facts& facts) {
  return {{"host", facts.host},           {"version", facts.version},       {"types", facts.types},
          {"domain", facts.domain},       {"discovery", facts.discovery},   {"identity", facts.identity},
          {"authority", facts.authority}, {"checks", to_json(facts.checks)}};
}

Result<Facts> parse_facts(const nlohmann::json& facts) {
  try {
    Facts result{.host = facts.at("host"),
                 .version = facts.at("version"),
                 .types = facts.at("types"),
                 .domain = facts.at("domain"),
                 .discovery = facts.at("discovery"),
                 .identity = facts.at("identity"),
                 .authority = facts.at("authority")};
    for (const auto& check : facts.at("checks")) {
      const std::string verdict = check.at("verdict");
      const auto known = std::ranges::find(kVerdicts, verdict, [](Verdict one) { return std::string(word(one)); });
      result.checks.push_back({.name = check.at("name"),
                               .verdict = known == std::end(kVerdicts) ? Verdict::kFail : *known,
                               .finding = check.at("finding"),
                               .remedy = check.at("remedy")});
    }
    return result;
  } catch (const nlohmann::json::exception& problem) {
    return Error{Code::kInvalidArgument, fmt::format("facts of the other doctor: {}", problem.what())};
  }
}

std::int64_t wall_clock_ns() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now().time_since_epoch())
      .count();
}

std::string test_datagram(const std::string& text, std::size_t bytes) {
  std::string datagram = text;
  datagram.resize(std::clamp(bytes, text.size(), std::max(text.size(), kLargestPayload)), '.');
  return datagram;
}

}  // namespace jostle::tools
