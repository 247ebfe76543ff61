#include "services/tools/doctor/environment.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <functional>
#include <iterator>
#include <sstream>
#include <string>
#include <string_view>
#include <thread>

#include "idl/text/nearest.hpp"
#include "services/common/process/environment.hpp"
#include "services/tools/doctor/peer.hpp"
#include "services/wire/dds/discovery.hpp"
#include "services/wire/security/identity.hpp"

namespace jostle::tools {
namespace {

using common::environment;
using common::NetworkChoice;

constexpr const char* kUnset = "unset it";
constexpr std::chrono::milliseconds kListening{1000};  // two announcements of those who are there

// --- how processes find each other --------------------------------------------

std::string reach(const NetworkChoice& choice) {
  if (choice.only_this_machine) return "; nothing leaves this machine, nobody else is heard";
  if (!choice.joins_group) return "; only this machine and the hosts listed";
  return "";
}

Check check_choice(const Result<NetworkChoice>& choice_result) {
  const std::string name = "discovery";
  if (!choice_result) return {name, Verdict::kFail, choice_result.error().message, "put that right, or --discovery"};
  const NetworkChoice& choice = *choice_result;
  if (const auto ok = wire::parse_discovery(choice.discovery); !ok) {
    return {name, Verdict::kFail, fmt::format("{}: {}", choice.origin, ok.error().message),
            "put that right; no program starts with it"};
  }
  return {
      name, Verdict::kOk,
      fmt::format("{}, by {}{}", choice.discovery, choice.origin.empty() ? "default" : choice.origin, reach(choice)),
      ""};
}

// --- variables ----------------------------------------------------------------

struct Variable {
  std::string_view name;
  /// Says what a value does; the check's name is the variable's.
  std::function<Check(const std::string& value, const Result<NetworkChoice>& choice)> judge;
};

Check fine(std::string finding) { return {"", Verdict::kOk, std::move(finding), ""}; }
Check dubious(std::string finding, std::string remedy) {
  return {"", Verdict::kWarn, std::move(finding), std::move(remedy)};
}

bool is_among(const std::vector<std::string>& settings, std::string_view name) {
  return std::ranges::any_of(settings,
                             [&](const std::string& one) { return one.starts_with(std::string(name) + "="); });
}

// One of those that can decide how processes find each other.
Check judge_demand(std::string_view name, const Result<NetworkChoice>& choice, const std::string& otherwise) {
  if (!choice) return dubious("see discovery", kUnset);
  if (choice->origin.find(std::string(name) + "=") != std::string::npos)
    return fine("in force; --discovery would overrule it");
  if (!is_among(choice->overruled, name)) return fine(otherwise);
  return dubious(fmt::format("has no say: {} decides", choice->origin.empty() ? choice->discovery : choice->origin),
                 fmt::format("{}, or the other one", kUnset));
}

bool through_servers(const Result<NetworkChoice>& choice) { return choice && choice->discovery.starts_with("server:"); }

Check judge_rmw(const std::string& value, const Result<NetworkChoice>& choice) {
  if (value.starts_with("rmw_fastrtps")) return fine("ROS 2 nodes have the same middleware");
  if (value.starts_with("rmw_zenoh"))
    return dubious("ROS 2 nodes do not speak DDS: they and Jostle do not hear each other",
                   "RMW_IMPLEMENTATION=rmw_fastrtps_cpp or rmw_cyclonedds_cpp where nodes are started");
  if (through_servers(choice))
    return dubious("its nodes know no discovery servers: they and Jostle do not meet",
                   "RMW_IMPLEMENTATION=rmw_fastrtps_cpp, or no server");
  return fine("ROS 2 nodes have another middleware, which hears Jostle");
}

Check judge_super_client(const std::string&, const Result<NetworkChoice>& choice) {
  if (!choice) return dubious("see discovery", kUnset);
  if (!through_servers(choice)) return fine("without a discovery server it means nothing");
  return fine(choice->super_client ? "servers tell programs here of everybody" : "no");
}

Check judge_folders(const std::string& value, const Result<NetworkChoice>&) {
  std::istringstream folders(value);
  std::error_code ignored;
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (!folder.empty() && !std::filesystem::is_directory(folder, ignored))
      return dubious(fmt::format("{}: there is no such folder", folder), "folders, with colons between");
  }
  return fine("looked through for robots");
}

Check judge_file(const std::string& value, const std::string& meaning) {
  if (access(value.c_str(), R_OK) == 0) return fine(meaning);
  return dubious("cannot be read", kUnset);
}

Check judge_shared_profiles(const std::string&, const Result<NetworkChoice>&) {
  if (!environment("JOSTLE_PROFILES").empty())
    return dubious("has no say: JOSTLE_PROFILES decides; ROS 2 nodes read it", "one file for both");
  return fine(environment("JOSTLE_DDS_TRANSPORT").empty()
                  ? "in force: transports are those of its default participant"
                  : "in force; its default participant has no say, JOSTLE_DDS_TRANSPORT decides");
}

Check judge_identity(const std::string& value, const Result<NetworkChoice>& choice) {
  const auto identity_result = wire::open_identity(value);
  if (!identity_result) return {"", Verdict::kFail, identity_result.error().message, "`jostle keys check` it"};
  if (through_servers(choice)) {
    return {"", Verdict::kFail, "protected programs cannot find each other through a discovery server",
            "--discovery multicast or peers:HOST,..., or no JOSTLE_SECURE"};
  }
  return fine(fmt::format("identity '{}', role {}", identity_result->name, wire::to_string(identity_result->role)));
}

Check judge_namespace(const std::string& value, const Result<NetworkChoice>&) {
  const auto space_result = wire::parse_namespace(value);
  if (!space_result) return {"", Verdict::kFail, space_result.error().message, kUnset};
  return fine("of the robot's topics");
}

const std::vector<Variable>& variables() {
  using Choice = Result<NetworkChoice>;
  static const auto ignored_by = [](const char* who) {
    return [who](const std::string&, const Choice&) {
      return dubious(fmt::format("no part of Jostle reads it, {}", who), "JOSTLE_PROFILES says the same to Jostle");
    };
  };
  static const std::vector<Variable> kVariables{
      {"ROS_DISCOVERY_SERVER",
       [](const auto&, const Choice& choice) {
         return judge_demand("ROS_DISCOVERY_SERVER", choice, "names no server");
       }},
      {"ROS_LOCALHOST_ONLY",
       [](const std::string& value, const Choice& choice) {
         if (choice && choice->only_this_machine && value == "1") return fine("in force");
         return judge_demand("ROS_LOCALHOST_ONLY", choice, "other machines may be heard");
       }},
      {"ROS_AUTOMATIC_DISCOVERY_RANGE",
       [](const auto&, const Choice& choice) {
         return judge_demand("ROS_AUTOMATIC_DISCOVERY_RANGE", choice, "multicast, as without it");
       }},
      {"ROS_STATIC_PEERS",
       [](const auto&, const Choice& choice) { return judge_demand("ROS_STATIC_PEERS", choice, "lists nobody"); }},
      {"ROS_SUPER_CLIENT", judge_super_client},
      {"RMW_IMPLEMENTATION", judge_rmw},
      {"FASTDDS_ENVIRONMENT_FILE",
       [](const std::string& value, const Choice&) { return judge_file(value, "its ROS_DISCOVERY_SERVER counts"); }},
      {"FASTRTPS_DEFAULT_PROFILES_FILE", judge_shared_profiles},
      {"FASTDDS_DEFAULT_PROFILES_FILE", ignored_by("nor Fast DDS 2.9; ROS 2 nodes of later releases do")},
      {"FASTDDS_BUILTIN_TRANSPORTS", ignored_by("nor Fast DDS 2.9; ROS 2 nodes of later releases do")},
      {"FASTDDS_STATISTICS",
       [](const auto&, const Choice&) {
         return dubious("the middleware publishes statistics beside what Jostle says", kUnset);
       }},
      {"JOSTLE_SECURE", judge_identity},
      {"JOSTLE_NAMESPACE", judge_namespace},
      {"JOSTLE_MODELS", judge_folders},
  };
  return kVariables;
}

// Ours that other checks, programs and scripts read.
constexpr std::string_view kOthers[] = {"JOSTLE_DISCOVERY",   "JOSTLE_PROFILES",  "JOSTLE_DDS_TRANSPORT",
                                        "JOSTLE_WORKER_ARGS", "JOSTLE_BUILD_DIR", "JOSTLE_COORDINATOR_ARGS",
                                        "JOSTLE_PACKAGE_DIR", "JOSTLE_CONTACT",   "JOSTLE_DISCOVERY_SERVER_ARGS"};

std::vector<Check> check_misspelt() {
  constexpr std::string_view kOurs = "JOSTLE_";
  std::vector<std::string> known;  // without what they have in common
  const auto note = [&](std::string_view name) {
    if (name.starts_with(kOurs)) known.emplace_back(name.substr(kOurs.size()));
  };
  std::ranges::for_each(kOthers, note);
  for (const Variable& one : variables()) note(one.name);
  std::vector<Check> checks;
  for (char** entry = environ; *entry; ++entry) {
    const std::string text = *entry, name = text.substr(0, text.find('='));
    if (!name.starts_with(kOurs)) continue;
    const std::string rest = name.substr(kOurs.size());
    if (std::ranges::count(known, rest) > 0) continue;
    const std::string meant = nearest(rest, known);
    checks.push_back({name, Verdict::kWarn, "no program reads it",
                      meant.empty() ? kUnset : fmt::format("did you mean {}{}?", kOurs, meant)});
  }
  return checks;
}

}  // namespace

std::vector<Check> check_environment() {
  const auto choice_result = common::choose_network();
  std::vector<Check> checks{check_choice(choice_result)};
  for (const Variable& one : variables()) {
    const std::string value = environment(std::string(one.name).c_str());
    if (value.empty()) continue;
    Check check = one.judge(value, choice_result);
    check.name = one.name;
    check.finding = fmt::format("{}: {}", value, check.finding);
    checks.push_back(std::move(check));
  }
  std::ranges::copy(check_misspelt(), std::back_inserter(checks));
  return checks;
}

std::vector<Check> check_joining(const wire::ParticipantOptions& options) {
  const auto participant_result = wire::Participant::open(options);
  if (!participant_result)
    return {{"participant", Verdict::kFail, participant_result.error().message, "put that right first"}};
  auto checks = check_discovery_servers(*participant_result);
  std::this_thread::sleep_for(kListening);
  const std::string finding = fmt::format("joins domain {}, hears {} others", participant_result->domain(),
                                          participant_result->others().size() - 1);  // we are one
  const std::string apart = participant_result->who_is_apart();
  if (apart.empty()) {
    checks.push_back({"participant", Verdict::kOk, finding, ""});
  } else {
    checks.push_back({"participant", Verdict::kWarn, fmt::format("{}; {}", finding, apart), "the same for all"});
  }
  return checks;
}

}  // namespace jostle::tools
