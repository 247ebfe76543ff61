// jostle run: one scene, from start to grasp or goal, on this machine.

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "physics_pool/uncertainty/belief.hpp"
#include "services/common/process/cores.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/task/config/parameters.hpp"
#include "services/task/config/predictor.hpp"
#include "services/task/run/display.hpp"
#include "services/task/run/report.hpp"
#include "services/task/run/session.hpp"

namespace {

using namespace jostle;
using namespace jostle::task;

struct Arguments {
  std::string scene, level = "none", parameters;
};

// Reads the files the arguments name.
Result<void> complete(const Arguments& arguments, RunOptions& options) {
  auto level_result = physics_pool::parse_uncertainty(arguments.level);
  if (!level_result) return level_result.error();
  options.level = *level_result;
  auto scene_result = physics_pool::load_scene(arguments.scene);
  if (!scene_result) return scene_result.error();
  options.scene = std::move(scene_result).value();
  options.planning = physics_pool::perturb(options.scene, options.level, options.seed);
  const auto controller_result = planners::find_controller(options.controller, options.planning);
  if (!controller_result) return Error{controller_result.error().code, "--" + controller_result.error().message};
  const planners::ControllerKind* kind = *controller_result;
  options.controller = kind->name;
  if (auto ok = Predictor::check(options.predictor, options.planning); !ok)
    return Error{ok.error().code, "--" + ok.error().message};
  const std::filesystem::path file =
      arguments.parameters.empty() ? common::data_file(kind->parameters) : std::filesystem::path(arguments.parameters);
  auto parameters_result = common::read_text(file);
  if (!parameters_result) return parameters_result.error();
  options.parameters = std::move(parameters_result).value();
  const auto parsed_result = parse_parameters(options.parameters, file.string());
  if (!parsed_result) return parsed_result.error();
  return check_fit(*parsed_result, options.planning);
}

int fail(const Error& error, int code) {
  fmt::print(stderr, "jostle run: {}\n", error.message);
  return code;
}

int perform(const RunOptions& options, std::stop_token stop) {
  common::LiveLine line("jostle run", options.headless ? common::PlainLines::kAlways : common::PlainLines::kElsewhere);
  Display display(line);
  auto session_result = Session::start(options, {.on_feedback = [&](const auto& feedback) { display.show(feedback); },
                                                 .on_notice = [&](const std::string& text) { line.say("{}", text); }});
  if (!session_result) {
    return fail(session_result.error(), common::exit_code_of(session_result.error()));
  }
  auto result = (*session_result)->perform(stop);
  line.finish();
  if (!result)
    return fail(result.error(),
                result.error().code == Code::kCancelled ? common::kExitInterrupted : common::kExitBroken);
  if (!result->error().empty()) return fail({Code::kUnavailable, result->error()}, common::kExitBroken);
  (*session_result)->finish_recording();
  session_result->reset();  // before drawing: every process it started is gone
  if (auto ok = leave_report(options, *result); !ok) return fail(ok.error(), common::kExitBroken);
  return result->success() ? common::kExitOk : common::kExitFailed;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Plans and executes a scene: starts workers, a simulated world and a coordinator, shows\n"
      "their progress, and ends them. More workers may join from anywhere: jostle worker.",
      "jostle run");
  Arguments arguments;
  RunOptions options;
  options.workers = common::usable_cores();
  bool pin = false;
  app.add_option("scene", arguments.scene, "Scene file; `jostle scene generate` makes one")->required();
  common::add_count_option(app, "--workers", options.workers, 0,
                           "Worker processes, or threads; auto: one per core this process may use")
      ->default_str("auto");
  app.add_flag("--pin", pin, "Give each worker process a core of its own, in turn");
  app.add_option("--controller", options.controller,
                 planners::controller_help() + " (default: the first that can do the task)");
  app.add_option(
         "--predictor", options.predictor,
         "What plans of pushes are made with: fine, coarse[,MODEL], parareal:K[,MODEL][,split] or\n"
         "parareal:adaptive[,MODEL][,split]; MODEL is kinematic, limit-surface, planar, learned or learned:FILE")
      ->capture_default_str();
  app.add_option("--uncertainty", arguments.level, "none, low, medium or high")->capture_default_str();
  app.add_option("--seed", options.seed, "Of all noise, the planner's and the world's")->capture_default_str();
  app.add_option("--pool", options.pool, "dds: worker processes; threads: threads of the coordinator")
      ->capture_default_str()
      ->check(CLI::IsMember({"dds", "threads"}));
  app.add_option("--parameters", arguments.parameters,
                 "Planner's and controller's (default: experiments/grasping.yaml, or pushing.yaml)");
  app.add_option("--json", options.json, "File for the result");
  app.add_option("--picture", options.picture, "PNG of the execution");
  app.add_option("--record", options.record, "Folder for a bag of the whole run; `jostle record` has more to say");
  app.add_option("--rate", options.rate, "World seconds per second while acting; 0: as fast as possible")
      ->capture_default_str()
      ->check(CLI::Range(0.0, 1000.0));
  app.add_flag("--plan-only", options.plan_only, "Stop after the first plan");
  app.add_flag("--headless", options.headless, "Plain lines instead of a live display");
  common::add_network_options(app);
  app.add_option("--domain", options.domain, "DDS domain (default: ROS_DOMAIN_ID, else 0)");
  app.footer(
      "Exit codes: 0 grasped or pushed to its goal, 1 not, 2 bad input, 3 a part of the system failed, 130 "
      "interrupted.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  if (options.pool == "threads" && options.workers == 0) {
    return fail({Code::kInvalidArgument, "--workers: got 0, wanted at least 1 thread"}, common::kExitUsage);
  }
  if (pin && options.pool == "threads") {
    return fail({Code::kInvalidArgument, "--pin: got --pool threads, wanted dds: only worker processes are pinned"},
                common::kExitUsage);
  }
  if (auto ok = common::check_outputs({{"--json", options.json, {}},
                                       {"--picture", options.picture, {".png"}},
                                       {"--record", options.record, {}, true}});
      !ok) {
    return fail(ok.error(), common::exit_code_of(ok.error()));
  }
  if (pin) options.cores = common::allowed_cores();
  const common::StopSignal signal;
  if (auto ok = complete(arguments, options); !ok) return fail(ok.error(), common::exit_code_of(ok.error()));
  try {
    return perform(options, signal.token());
  } catch (const wire::SetupError& error) {
    return fail({Code::kUnavailable, error.what()}, common::kExitBroken);
  }
}
