// jostle doctor: what is wrong with this machine, and the remedy.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iterator>
#include <nlohmann/json.hpp>
#include <vector>

#include "services/doctor/machine.hpp"
#include "services/doctor/network.hpp"
#include "services/doctor/shared_memory.hpp"
#include "services/support/program.hpp"

namespace jostle::services {
namespace {


std::vector<Check> examine() {
  std::vector<Check> checks{check_shared_memory(), check_leftovers()};
  std::ranges::copy(check_multicast(), std::back_inserter(checks));
  checks.push_back(check_udp_buffers());
  checks.push_back(check_domain());
  checks.push_back(check_cores());
  std::ranges::copy(check_versions(), std::back_inserter(checks));
  checks.push_back(check_worker());
  return checks;
}

const char* word(Verdict verdict) {
  switch (verdict) {
    case Verdict::kOk: return "ok";
    case Verdict::kWarn: return "warn";
    case Verdict::kFail: break;
  }
  return "FAIL";
}

void print_lines(const std::vector<Check>& checks) {
  for (const Check& check : checks) {
    fmt::print("{:4}  {:16} {}{}{}\n", word(check.verdict), check.name, check.finding,
               check.remedy.empty() ? "" : "; remedy: ", check.remedy);
  }
}

void print_json(const std::vector<Check>& checks) {
  nlohmann::json list = nlohmann::json::array();
  for (const Check& check : checks) {
    list.push_back({{"name", check.name}, {"verdict", word(check.verdict)},
                    {"finding", check.finding}, {"remedy", check.remedy}});
  }
  fmt::print("{}\n", list.dump(2));
}

}  // namespace
}  // namespace jostle::services

int main(int argc, char** argv) {
  using namespace jostle::services;
  bool as_json = false, clean = false;
  CLI::App app{"Says what is wrong with this machine, and the remedy. Exits with 1 if anything FAILs.",
               "jostle doctor"};
  app.add_flag("--json", as_json, "a list of {name, verdict, finding, remedy}");
  app.add_flag("--clean", clean, "first remove shared memory that killed processes left behind");
  if (const auto code = parse_arguments(app, argc, argv)) return *code;
  if (clean) remove_leftovers(find_leftovers());
  const std::vector<Check> checks = examine();
  as_json ? print_json(checks) : print_lines(checks);
  const bool failed = std::ranges::any_of(checks, [](const Check& check) { return check.verdict == Verdict::kFail; });
  return failed ? kExitFailed : 0;
}
