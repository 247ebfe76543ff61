// jostle bench: ratios measured inside one run, on this machine.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <optional>

#include "services/common/process/command_line.hpp"
#include "services/common/process/domain_claim.hpp"
#include "services/common/process/program.hpp"
#include "services/studies/bench/catalogue.hpp"

namespace jostle::studies {
namespace {

constexpr const char* kSpeaker = "jostle bench";

int fail(const Error& error) {
  if (error.code == Code::kCancelled) {
    fmt::print(stderr, "{}: interrupted\n", kSpeaker);
    return common::kExitInterrupted;
  }
  fmt::print(stderr, "{}: {}\n", kSpeaker, error.message);
  return common::exit_code_of(error);
}

int list(const std::vector<std::unique_ptr<Benchmark>>& benchmarks) {
  for (const auto& benchmark : benchmarks) {
    if (!benchmark->takes.empty())
      fmt::print("{:<20} {} (about {})\n", benchmark->name, benchmark->purpose, benchmark->takes);
  }
  return common::kExitOk;
}

int run(Benchmark& benchmark, std::optional<int> domain) {
  if (auto ok = benchmark.check(); !ok) return fail(ok.error());
  // Neither a user's system nor another benchmark is in the way.
  std::optional<common::OwnDomain> own;
  if (!domain && benchmark.uses == Benchmark::Uses::kDomain) {
    auto own_result = common::claim_some_domain();
    if (!own_result) return fail(own_result.error());
    own = std::move(own_result).value();
    domain = own->domain;
  }
  const common::StopSignal signal;
  WorkLine line(fmt::format("{} {}", kSpeaker, benchmark.name), benchmark.unit());
  try {
    const auto code_result = benchmark.run({.domain = domain.value_or(0), .stop = signal.token(), .line = &line});
    line.end();
    return code_result ? *code_result : fail(code_result.error());
  } catch (const std::exception& error) {  // the middleware's SetupError, the engine's errors
    line.end();
    fmt::print(stderr, "{}: {}\n", kSpeaker, error.what());
    return common::kExitBroken;
  }
}

}  // namespace
}  // namespace jostle::studies

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::studies;
  CLI::App app(
      "Measures the ratio of two ways to do the same work, in turns, on this machine. `jostle bench NAME --help`\n"
      "lists the options of a benchmark.",
      kSpeaker);
  app.require_subcommand(0, 1);
  std::string unknown;
  std::optional<int> domain;
  const auto benchmarks = all_benchmarks();
  for (const auto& benchmark : benchmarks) {
    const bool is_public = !benchmark->takes.empty();
    CLI::App* command = app.add_subcommand(
        benchmark->name, is_public ? fmt::format("{} (about {})", benchmark->purpose, benchmark->takes) : "");
    if (!is_public) command->group("");
    benchmark->add_options(*command);
    if (benchmark->uses == Benchmark::Uses::kDomain) {
      common::add_network_options(*command);
      command->add_option("--domain", domain, "DDS domain (default: one of its own, 1 to 100)")
          ->check(CLI::Range(0, 232));
    }
    command->footer(
        "Exit codes: 0 measured, 1 the two sides computed different things, 2 bad arguments,\n"
        "3 a part of the system failed, 130 interrupted: what was measured is printed. Slowness is no failure.");
  }
  const CLI::App* lists = app.add_subcommand("list", "list the benchmarks, and how long each takes");
  app.add_option("name", unknown)->group("");  // what is no benchmark ends up here
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;

  if (lists->parsed()) return list(benchmarks);
  for (const auto& benchmark : benchmarks) {
    if (app.get_subcommand(benchmark->name)->parsed()) return run(*benchmark, domain);
  }
  if (unknown.empty()) unknown = "nothing";
  fmt::print(stderr, "{}: name: got '{}', wanted one that `jostle bench list` shows\n", kSpeaker, unknown);
  return common::kExitUsage;
}
