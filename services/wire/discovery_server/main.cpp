// jostle discovery-server: where machines without multicast meet.

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>

#include "services/common/process/command_line.hpp"
#include "services/common/process/program.hpp"
#include "services/wire/dds/participant.hpp"

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::wire;
  CLI::App app(
      "Introduces processes to each other on networks without multicast; carries none of their data.\n"
      "Give every other program --discovery server:HOST[:PORT]. Runs until it is told to end.",
      "jostle discovery-server");
  ServerOptions server;
  common::ProcessOptions process;
  app.add_option("--listen", server.address, "IPv4 address of this host; 0.0.0.0: all of them")
      ->capture_default_str()
      ->check(CLI::ValidIPV4);
  app.add_option("--port", server.port, "UDP port")->capture_default_str()->check(common::port(1));
  app.add_option("--id", server.id, "Its place, from 0, in the list of servers that the others are given")
      ->capture_default_str()
      ->check(CLI::Range(0, 255));
  common::add_domain_options(app, process);
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  common::die_with_parent(process.parent);
  const common::StopSignal signal;
  common::set_up_logging("discovery-server");
  const auto participant_result =
      Participant::open_server({.name = "jostle_discovery_server", .domain = process.domain}, server);
  if (!participant_result) {
    spdlog::error("{}", participant_result.error().message);
    return participant_result.error().code == Code::kInvalidArgument ? common::kExitUsage : common::kExitBroken;
  }
  spdlog::info("listens at {}:{}, domain {}", server.address, server.port, participant_result->domain());
  common::wait_for(signal.token());
  return common::kExitOk;
}
