#include "services/wire/security/documents.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <tinyxml2.h>

#include <algorithm>
#include <iomanip>
#include <optional>
#include <sstream>

namespace jostle::wire {
namespace {

using tinyxml2::XMLElement;

constexpr const char* kDomains = "<domains><id_range><min>0</min><max>232</max></id_range></domains>";

std::string criteria_text(const char* kind, const std::vector<std::string>& topics) {
  if (topics.empty()) return "";
  std::string text = fmt::format("        <{}><topics>", kind);
  for (const std::string& topic : topics) text += fmt::format("<topic>{}</topic>", topic);
  return text + fmt::format("</topics></{}>\n", kind);
}

std::vector<std::string> parts_of(const std::string& subject) {
  std::vector<std::string> parts;
  std::istringstream text(subject);
  for (std::string part; std::getline(text, part, ',');) {
    const auto first = part.find_first_not_of(' ');
    const auto last = part.find_last_not_of(' ');
    parts.push_back(first == std::string::npos ? "" : part.substr(first, last - first + 1));
  }
  return parts;
}

Error malformed(const std::filesystem::path& file, const XMLElement* where, const std::string& got_and_wanted) {
  return {Code::kInvalidArgument,
          fmt::format("{}: line {} of its text: {}", file.string(), where ? where->GetLineNum() : 1, got_and_wanted)};
}

std::string text_of(const XMLElement* element) {
  const char* text = element ? element->GetText() : nullptr;
  return text ? text : "";
}

Result<void> parse(const std::filesystem::path& file, const std::string& text, const char* root,
                   tinyxml2::XMLDocument& document) {
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    return Error{Code::kInvalidArgument, fmt::format("{}: got no XML ({})", file.string(), document.ErrorStr())};
  }
  // The parser takes a text without any element, or with an end of none, for XML.
  const XMLElement* got = document.RootElement();
  if (!got) return malformed(file, nullptr, fmt::format("got no element, wanted <{}>", root));
  if (std::string_view(got->Name()) == root) return {};
  return malformed(file, got, fmt::format("got <{}>, wanted <{}>", got->Name(), root));
}

// Fast DDS reads these dates in the local time of the machine, whatever zone
// they name; to say beforehand what it will do, so do we.
std::optional<std::time_t> parse_date(const XMLElement* element) {
  std::tm parts{};
  std::istringstream text(text_of(element));
  text >> std::get_time(&parts, "%Y-%m-%dT%T");
  if (text.fail()) return {};
  return std::mktime(&parts);
}

void collect_topics(const XMLElement& rule, const char* kind, std::vector<std::string>& topics) {
  for (auto* criteria = rule.FirstChildElement(kind); criteria; criteria = criteria->NextSiblingElement(kind)) {
    for (auto* list = criteria->FirstChildElement("topics"); list; list = list->NextSiblingElement("topics")) {
      for (auto* topic = list->FirstChildElement("topic"); topic; topic = topic->NextSiblingElement("topic")) {
        topics.push_back(text_of(topic));
      }
    }
  }
}

Result<Grant> parse_grant(const std::filesystem::path& file, const XMLElement& element) {
  Grant grant{.subject = text_of(element.FirstChildElement("subject_name"))};
  if (grant.subject.empty()) return malformed(file, &element, "<subject_name>: got none");
  const XMLElement* validity = element.FirstChildElement("validity");
  const auto date = [&](const char* name) {
    return validity ? parse_date(validity->FirstChildElement(name)) : std::nullopt;
  };
  const auto not_before = date("not_before"), not_after = date("not_after");
  if (!not_before || !not_after) {
    return malformed(file, &element, "<validity>: wanted <not_before> and <not_after> such as 2026-01-31T12:00:00");
  }
  grant.validity = {.not_before = *not_before, .not_after = *not_after};
  for (auto* rule = element.FirstChildElement("allow_rule"); rule; rule = rule->NextSiblingElement("allow_rule")) {
    collect_topics(*rule, "publish", grant.rights.publish);
    collect_topics(*rule, "subscribe", grant.rights.subscribe);
  }
  return grant;
}

}  // namespace

std::string governance_text() {
  return fmt::format(R"(<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">
  <domain_access_rules>
    <domain_rule>
      {}
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>SIGN</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>ENCRYPT</metadata_protection_kind>
          <data_protection_kind>ENCRYPT</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
)",
                     kDomains);
}

// A rule that allows no topic still lets its holder join a domain.
std::string permissions_text(const Grant& grant) {
  constexpr auto kDate = "{:%Y-%m-%dT%H:%M:%S}";
  return fmt::format(R"(<?xml version="1.0" encoding="UTF-8"?>
<dds xmlns:xsi="http://www.w3.org/2001/XMLSchema-instance">
  <permissions>
    <grant name="jostle">
      <subject_name>{}</subject_name>
      <validity><not_before>{}</not_before><not_after>{}</not_after></validity>
      <allow_rule>
        {}
{}{}      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
)",
                     grant.subject, fmt::format(kDate, fmt::gmtime(grant.validity.not_before)),
                     fmt::format(kDate, fmt::gmtime(grant.validity.not_after)), kDomains,
                     criteria_text("publish", grant.rights.publish),
                     criteria_text("subscribe", grant.rights.subscribe));
}

Result<std::vector<Grant>> parse_permissions(const std::filesystem::path& file, const std::string& text) {
  tinyxml2::XMLDocument document;
  if (auto ok = parse(file, text, "dds", document); !ok) return ok.error();
  const XMLElement* permissions = document.RootElement()->FirstChildElement("permissions");
  std::vector<Grant> grants;
  for (auto* element = permissions ? permissions->FirstChildElement("grant") : nullptr; element;
       element = element->NextSiblingElement("grant")) {
    auto grant_result = parse_grant(file, *element);
    if (!grant_result) return grant_result.error();
    grants.push_back(std::move(*grant_result));
  }
  if (grants.empty()) return malformed(file, document.RootElement(), "got no <grant>, wanted one in <permissions>");
  return grants;
}

Result<void> check_governance(const std::filesystem::path& file, const std::string& text) {
  tinyxml2::XMLDocument document;
  if (auto ok = parse(file, text, "dds", document); !ok) return ok.error();
  const XMLElement* rules = document.RootElement()->FirstChildElement("domain_access_rules");
  if (rules && rules->FirstChildElement("domain_rule")) return {};
  return malformed(file, document.RootElement(), "got no <domain_rule>, wanted one in <domain_access_rules>");
}

bool same_subject(const std::string& a, const std::string& b) { return parts_of(a) == parts_of(b); }

bool same_parts(const std::string& a, const std::string& b) {
  auto parts_a = parts_of(a), parts_b = parts_of(b);
  std::ranges::sort(parts_a);
  std::ranges::sort(parts_b);
  return parts_a == parts_b;
}

}  // namespace jostle::wire
