#include "services/common/process/environment.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>
#include <ranges>
#include <string_view>

namespace jostle::common {
namespace {

constexpr const char* kServer = "ROS_DISCOVERY_SERVER";
constexpr const char* kLocalhost = "ROS_LOCALHOST_ONLY";
constexpr const char* kRange = "ROS_AUTOMATIC_DISCOVERY_RANGE";
constexpr const char* kPeers = "ROS_STATIC_PEERS";
constexpr const char* kSuperClient = "ROS_SUPER_CLIENT";

Error wrong(const char* variable, const std::string& got, const std::string& wanted) {
  return {Code::kInvalidArgument, fmt::format("{}: got '{}', wanted {}", variable, got, wanted)};
}

std::string setting(const char* variable) { return fmt::format("{}={}", variable, environment(variable)); }

// The middleware would read this file, and prefer it to the variable.
std::string discovery_server() {
  std::ifstream file(environment("FASTDDS_ENVIRONMENT_FILE"));
  const auto json = nlohmann::json::parse(file, nullptr, false);
  if (json.is_object() && json.contains("environment_variables")) {
    const auto& variables = json["environment_variables"];
    if (variables.is_object() && variables.contains(kServer) && variables[kServer].is_string())
      return variables[kServer].get<std::string>();
  }
  return environment(kServer);
}

std::vector<std::string> split(const std::string& text) {
  std::vector<std::string> parts;
  for (const auto part : text | std::views::split(';')) {
    std::string word(part.begin(), part.end());
    std::erase_if(word, [](char c) { return c == ' '; });
    parts.push_back(std::move(word));
  }
  while (!parts.empty() && parts.back().empty()) parts.pop_back();
  return parts;
}

Result<bool> read_flag(const char* variable, const std::vector<std::string_view>& yes,
                       const std::vector<std::string_view>& no) {
  const std::string text = environment(variable);
  if (text.empty() || std::ranges::count(no, text) > 0) return false;
  if (std::ranges::count(yes, text) > 0) return true;
  return wrong(variable, text, fmt::format("{} or {}", fmt::join(no, ", "), fmt::join(yes, ", ")));
}

Result<bool> only_this_machine() { return read_flag(kLocalhost, {"1"}, {"0"}); }

// Those of ROS 2's variables that ask for something else than multicast; SUBNET and 0 do not.
std::vector<std::string> demands() {
  std::vector<std::string> found;
  if (!discovery_server().empty()) found.push_back(fmt::format("{}={}", kServer, discovery_server()));
  if (const std::string text = environment(kLocalhost); !text.empty() && text != "0")
    found.push_back(setting(kLocalhost));
  const std::string range = environment(kRange);
  if (!range.empty() && range != "SUBNET" && range != "SYSTEM_DEFAULT") found.push_back(setting(kRange));
  if (!environment(kPeers).empty()) found.push_back(setting(kPeers));
  return found;
}

std::vector<std::string> demands_without(std::string_view one, std::string_view other = "") {
  auto found = demands();
  std::erase_if(found, [&](const std::string& text) {
    return text.starts_with(one) || (!other.empty() && text.starts_with(other));
  });
  return found;
}

bool is_here(const std::string& server) {
  const std::string host = server.substr(0, server.find(':'));
  return host.empty() || host == "localhost" || host.starts_with("127.");
}

Result<NetworkChoice> through_server(const std::string& text) {
  const auto servers = split(text);
  NetworkChoice choice{.discovery = fmt::format("server:{}", fmt::join(servers, ",")),
                       .origin = fmt::format("{}={}", kServer, text),
                       .overruled = demands_without(kServer, kLocalhost)};
  const auto here_result = only_this_machine();
  if (!here_result) return here_result.error();
  choice.only_this_machine = *here_result;
  if (choice.only_this_machine && !std::ranges::all_of(servers, is_here)) {
    return wrong(kServer, text,
                 fmt::format("one on this machine, such as 127.0.0.1, as {}=1 keeps everything here; unset one of the "
                             "two, or give --discovery",
                             kLocalhost));
  }
  return choice;
}

Result<NetworkChoice> by_range() {
  static constexpr std::array<std::string_view, 4> kRanges{"SUBNET", "LOCALHOST", "SYSTEM_DEFAULT", "OFF"};
  const std::string text = environment(kRange), range = text.empty() ? "SUBNET" : text;
  if (std::ranges::count(kRanges, range) == 0) return wrong(kRange, text, fmt::format("{}", fmt::join(kRanges, ", ")));
  if (range == "OFF") {
    return wrong(kRange, text,
                 "LOCALHOST, SUBNET or SYSTEM_DEFAULT: with OFF no process finds another, and Jostle is several; unset "
                 "it, or give --discovery");
  }
  auto peers = split(environment(kPeers));
  std::erase(peers, "");
  const std::string list = fmt::format("{}", fmt::join(peers, ","));
  if (range == "LOCALHOST") {
    return NetworkChoice{.discovery = "peers:" + (list.empty() ? "127.0.0.1" : list),
                         .origin = setting(kRange) + (list.empty() ? "" : ", " + setting(kPeers)),
                         .joins_group = false};
  }
  if (list.empty()) return NetworkChoice{};
  if (range == "SYSTEM_DEFAULT") return NetworkChoice{.overruled = {setting(kPeers)}};
  return NetworkChoice{.discovery = "multicast+peers:" + list, .origin = setting(kPeers)};
}

Result<NetworkChoice> choose() {
  if (const std::string text = environment("JOSTLE_DISCOVERY"); !text.empty()) {
    return NetworkChoice{.discovery = text, .origin = "--discovery " + text, .overruled = demands()};
  }
  if (const std::string servers = discovery_server(); !split(servers).empty()) return through_server(servers);
  const auto here_result = only_this_machine();
  if (!here_result) return here_result.error();
  if (!*here_result) return by_range();
  return NetworkChoice{.discovery = "localhost",
                       .origin = setting(kLocalhost),
                       .only_this_machine = true,
                       .joins_group = false,
                       .overruled = demands_without(kLocalhost)};
}

}  // namespace

std::string environment(const char* variable) {
  const char* text = std::getenv(variable);
  return text ? text : "";
}

Result<NetworkChoice> choose_network() {
  auto choice_result = choose();
  if (!choice_result) return choice_result;
  if (choice_result->discovery == "localhost") {
    choice_result->only_this_machine = true;
    choice_result->joins_group = false;
  }
  if (choice_result->discovery.starts_with("server:")) {
    const auto super_result = read_flag(kSuperClient, {"1", "TRUE", "True", "true"}, {"0", "FALSE", "False", "false"});
    if (!super_result) return super_result.error();
    choice_result->super_client = *super_result;
  }
  return choice_result;
}

std::vector<std::string> network_news(const NetworkChoice& choice) {
  std::vector<std::string> news;
  if (choice.origin.starts_with("ROS_")) {
    news.push_back(fmt::format("{} decides how processes find each other: {}{}; --discovery would overrule it",
                               choice.origin, choice.discovery,
                               choice.only_this_machine ? ", nothing leaves this machine" : ""));
  }
  if (!choice.overruled.empty()) {
    const std::string& winner = choice.origin.empty() ? choice.discovery : choice.origin;
    news.push_back(fmt::format("{} is in force, and not {}", winner, fmt::join(choice.overruled, ", ")));
  }
  return news;
}

}  // namespace jostle::common
