// jostle doctor: what is wrong with this machine, and the remedy.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <vector>

#include "services/common/process/command_line.hpp"
#include "services/common/process/program.hpp"
#include "services/tools/doctor/environment.hpp"
#include "services/tools/doctor/facts.hpp"
#include "services/tools/doctor/listen.hpp"
#include "services/tools/doctor/machine.hpp"
#include "services/tools/doctor/network.hpp"
#include "services/tools/doctor/peer.hpp"
#include "services/tools/doctor/sensors.hpp"
#include "services/tools/doctor/shared_memory.hpp"

namespace jostle::tools {
namespace {

struct Arguments {
  bool as_json = false, clean = false, listen = false;
  std::string camera;  // empty: not looked at
  std::optional<perception::natnet::Client::Options> mocap;
  PeerOptions peer{.host = "", .port = kDoctorPort};
  wire::ParticipantOptions participant{.name = "jostle_doctor", .domain = {}, .waits_for_server = true};
};

// This machine. Before any participant is made.
std::vector<Check> examine(std::optional<int> domain) {
  std::vector<Check> checks = check_environment();
  checks.push_back(check_addresses());
  checks.push_back(check_shared_memory());
  checks.push_back(check_leftovers());
  if (finds_by_multicast()) std::ranges::copy(check_multicast(), std::back_inserter(checks));
  checks.push_back(check_profiles());
  checks.push_back(check_udp_buffers());
  checks.push_back(check_domain(domain));
  checks.push_back(check_cores());
  std::ranges::copy(check_versions(), std::back_inserter(checks));
  checks.push_back(check_worker());
  return checks;
}

void print_lines(const std::vector<Check>& checks) {
  std::size_t width = 16;
  for (const Check& check : checks) width = std::max(width, check.name.size());
  for (const Check& check : checks) {
    fmt::print("{:4}  {:{}} {}{}{}\n", word(check.verdict), check.name, width, check.finding,
               check.remedy.empty() ? "" : "; remedy: ", check.remedy);
  }
}

int listen(const Arguments& arguments, std::stop_token stop) {
  const auto fail = [](const Error& error, int code) {
    fmt::print(stderr, "jostle doctor: {}\n", error.message);
    return code;
  };
  const auto checks = examine(arguments.participant.domain);
  const auto participant_result = wire::Participant::open(arguments.participant);
  if (!participant_result) return fail(participant_result.error(), common::kExitUsage);
  auto door_result = Door::open(arguments.peer.port);
  if (!door_result) return fail(door_result.error(), common::kExitBroken);
  const auto notice = [](const std::string& text) { fmt::print(stderr, "jostle doctor: {}\n", text); };
  notice(fmt::format("listens at TCP port {}, domain {}; on the other host: jostle doctor --peer HOST",
                     arguments.peer.port, participant_result->domain()));
  listen_to_peers(
      *participant_result, std::move(door_result).value(),
      [&] {
        auto all = checks;
        std::ranges::copy(check_discovery_servers(*participant_result), std::back_inserter(all));
        return all;
      },
      notice, std::move(stop));
  return common::kExitOk;
}

Result<std::vector<Check>> examine_eyes(const Arguments& arguments) {
  std::vector<Check> checks;
  if (arguments.mocap) checks = check_mocap(*arguments.mocap);
  if (arguments.camera.empty()) return checks;
  const auto participant_result = wire::Participant::open(arguments.participant);
  if (!participant_result) return participant_result.error();
  std::ranges::copy(check_camera(*participant_result, arguments.camera), std::back_inserter(checks));
  return checks;
}

int report(const Arguments& arguments) {
  std::vector<Check> checks = examine(arguments.participant.domain);
  const auto joined = arguments.peer.host.empty() ? check_joining(arguments.participant)
                                                  : check_peer(arguments.peer, arguments.participant);
  std::ranges::copy(joined, std::back_inserter(checks));
  const auto eyes_result = examine_eyes(arguments);
  if (!eyes_result) {
    fmt::print(stderr, "jostle doctor: {}\n", eyes_result.error().message);
    return common::kExitUsage;
  }
  std::ranges::copy(*eyes_result, std::back_inserter(checks));
  if (arguments.as_json) {
    fmt::print("{}\n", to_json(checks).dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
  } else {
    print_lines(checks);
  }
  const bool failed = std::ranges::any_of(checks, [](const Check& check) { return check.verdict == Verdict::kFail; });
  return failed ? common::kExitFailed : common::kExitOk;
}

}  // namespace
}  // namespace jostle::tools

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::tools;
  Arguments arguments;
  CLI::App app{
      "Says what is wrong with this machine, and the remedy; with --peer also what is wrong between it and\n"
      "another one, on which `jostle doctor --listen` runs; with --mocap and --camera what is wrong with what\n"
      "they send. Exits with 1 if anything FAILs.",
      "jostle doctor"};
  app.add_flag("--json", arguments.as_json, "a list of {name, verdict, finding, remedy}");
  app.add_flag("--clean", arguments.clean, "first remove shared memory that killed processes left behind");
  auto* listens = app.add_flag("--listen", arguments.listen, "Answer the doctor of another host, until told to end");
  app.add_option("--peer", arguments.peer.host, "Address or name of a host: check what works between it and this one")
      ->excludes(listens);
  app.add_option("--port", arguments.peer.port, "TCP, at which the listening one answers")
      ->capture_default_str()
      ->check(common::port(1));
  std::string mocap;
  auto* mocap_option =
      app.add_option("--mocap", mocap, "Address or name of a motion capture's server (NatNet): listen to it")
          ->excludes(listens);
  app.add_option("--camera", arguments.camera, "Listen to the camera of ROS 2 whose images are on NAME/image_raw")
      ->type_name("NAME")
      ->excludes(listens);
  common::ProcessOptions process;
  common::add_process_options(app, process);
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  common::die_with_parent(process.parent);
  arguments.participant.domain = process.domain;
  if (*mocap_option) arguments.mocap = {.host = mocap};
  if (arguments.clean) remove_leftovers(find_leftovers());
  try {
    if (!arguments.listen) return report(arguments);
    const common::StopSignal signal;
    return listen(arguments, signal.token());
  } catch (const jostle::wire::SetupError& error) {
    fmt::print(stderr, "jostle doctor: {}\n", error.what());
    return common::kExitBroken;
  }
}
