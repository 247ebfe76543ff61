// jostle replay: makes the decisions of a recorded run again, and compares them.

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "physics_pool/local/thread_pool.hpp"
#include "planners/controllers/catalogue.hpp"
#include "services/bags/replay/changes.hpp"
#include "services/bags/replay/report.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/cores.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/common/results/results.hpp"

namespace jostle::bags {
namespace {

struct Arguments {
  std::string bag, goal, controller, json;
  int threads = common::usable_cores();
  ReplayOptions options;
};

int fail(const Error& error) {
  fmt::print(stderr, "jostle replay: {}\n", error.message);
  return common::exit_code_of(error);
}

// The runs that were asked for.
Result<std::vector<RecordedRun>> load(const Arguments& arguments) {
  auto reader_result = BagReader::open(arguments.bag);
  if (!reader_result) return reader_result.error();
  auto runs_result = read_runs(**reader_result);
  if (!runs_result) return runs_result.error();
  return select_runs(std::move(runs_result).value(), arguments.goal);
}

// Before a word is said of any run.
Result<void> check_settings(const std::vector<RecordedRun>& runs, const ReplayOptions& options) {
  for (const RecordedRun& run : runs) {
    jostle_msgs::msg::Goal goal = run.run.goal();
    if (auto changes_result = apply_changes(options.settings, goal); !changes_result) return changes_result.error();
  }
  return {};
}

int perform(Arguments arguments, std::stop_token stop) {
  auto runs_result = load(arguments);
  if (!runs_result) return fail(runs_result.error());
  if (!arguments.controller.empty())
    arguments.options.settings.insert(arguments.options.settings.begin(), "controller=" + arguments.controller);
  if (auto ok = check_settings(*runs_result, arguments.options); !ok) return fail(ok.error());
  arguments.options.on_plan = [](const auto& replayed, const auto* recorded, const StateLayout& layout) {
    fmt::print("{}", plan_line(replayed, recorded, layout));
    std::fflush(stdout);
  };
  physics_pool::ThreadPool pool(arguments.threads);
  nlohmann::json json{{"bag", arguments.bag}, {"runs", nlohmann::json::array()}};
  bool equal = true;
  for (const RecordedRun& run : *runs_result) {
    fmt::print("{}", headline(run));
    if (run.plans.empty() && arguments.options.settings.empty()) {  // a plan made now would be compared with none
      fmt::print("{}", kNothingToCompare);
      continue;
    }
    auto report_result = replay(run, arguments.options, pool, stop);
    if (!report_result) return fail(report_result.error());
    fmt::print("{}", verdict(run, *report_result));
    equal = equal && report_result->comparison.bit_equal();
    json["runs"].push_back(to_json(run, *report_result));
  }
  if (!arguments.json.empty()) {
    if (auto ok = common::write_results(arguments.json, json); !ok) return fail(ok.error());
  }
  return equal ? common::kExitOk : common::kExitFailed;
}

}  // namespace
}  // namespace jostle::bags

int main(int argc, char** argv) {
  using namespace jostle;
  using namespace jostle::bags;
  CLI::App app(
      "Gives what a recorded run observed to its planner again and compares every plan and every action.\n"
      "The same build on the same type of machine decides the same, to the last bit, at any rate.",
      "jostle replay");
  Arguments arguments;
  app.add_option("bag", arguments.bag, "Folder or file that `jostle run --record` or `jostle record` left")->required();
  app.add_option("--goal", arguments.goal, "Only this run of the bag (default: all)");
  common::suggest(app.add_option("--controller", arguments.controller,
                                 "What if another had decided: or, nr, mpc, ol, rol, cp, cc, ocl"),
                  planners::controller_names());
  app.add_option(
         "--set", arguments.options.settings,
         "What if an option had been another, KEY=VALUE: predictor, seed, plan_only, or a key of the parameters\n"
         "such as planner.rollouts; again for more")
      ->type_name("KEY=VALUE")
      ->take_all();
  app.add_option("--rate", arguments.options.rate,
                 "Recorded seconds per second between observations; 0: as fast as possible")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1000.0));
  common::add_count_option(app, "--threads", arguments.threads, 1,
                           "That simulate; auto: one per core this process may use")
      ->default_str("auto");
  app.add_option("--json", arguments.json, "File for the comparison");
  app.footer("Exit codes: 0 bit-equal, 1 not, 2 bad input, 3 a part of the system failed, 130 interrupted.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  if (auto ok = common::check_outputs({{.option = "--json", .path = arguments.json, .endings = {}}}); !ok)
    return fail(ok.error());
  const common::StopSignal signal;
  return perform(std::move(arguments), signal.token());
}
