// jostle play: a bag, published as it was recorded.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "services/bags/play/player.hpp"
#include "services/bags/play/remote_control.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"

namespace {

using namespace jostle;
using namespace jostle::bags;

struct Arguments {
  std::string bag, json;
  std::vector<std::string> topics, excluded, remaps, controls;
  double start = 0.0, duration = 0.0, timeout = 30.0;  // s
  bool verbose = false;
};

constexpr double kMostSeconds = 4e9;  // from 1970 to beyond today

int exit_code(const Error& error) {
  if (error.code == Code::kCancelled) return common::kExitInterrupted;
  return error.code == Code::kUnavailable ? common::kExitBroken : common::kExitUsage;
}

int fail(const Error& error) {
  fmt::print(stderr, "jostle play: {}\n", error.message);
  return exit_code(error);
}

double milliseconds(std::chrono::nanoseconds time) { return std::chrono::duration<double, std::milli>(time).count(); }

nlohmann::json to_json(const PlayReport& report, const std::string& bag) {
  return {{"bag", bag},
          {"seconds", report.seconds},
          {"passes", report.passes},
          {"messages", report.messages},
          {"sent", report.sent},
          {"refused", report.refused},
          {"late_ms",
           {{"median", milliseconds(report.lateness.quantile(0.5))},
            {"p99", milliseconds(report.lateness.quantile(0.99))},
            {"worst", milliseconds(report.lateness.worst())}}},
          {"reason", report.reason},
          {"problem", report.problem ? report.problem->message : ""}};
}

void tell_what_is_left_out(const TopicPlan& plan, bool verbose, common::LiveLine& line) {
  if (!plan.commands.empty()) {
    line.say("not played, because a robot would obey: {}; name a topic in full to play it",
             fmt::join(plan.commands, ", "));
  }
  for (const std::string& reason : plan.impossible) line.say("not played: {}", reason);
  std::string states;
  for (const PlayedTopic& topic : plan.played) {
    if (topic.is_state) states += (states.empty() ? "" : ", ") + topic.name;
  }
  if (verbose && !states.empty()) line.say("after a seek the last message of these is sent again: {}", states);
}

int play(const Arguments& arguments, PlayerOptions options, std::stop_token stop) {
  TopicChoice choice{.selection = {.topics = arguments.topics, .excluded = arguments.excluded},
                     .with_clock = options.clock > 0};
  for (const std::string& text : arguments.remaps) {
    auto remap_result = parse_remap(text);
    if (!remap_result) return fail(remap_result.error());
    choice.remaps.push_back(std::move(*remap_result));
  }
  auto reader_result = BagReader::open(arguments.bag);
  if (!reader_result) return fail(reader_result.error());
  std::vector<std::string> findings;
  for (const Finding& finding : (*reader_result)->findings()) findings.push_back(finding.text());
  const auto plan_result = plan_topics((*reader_result)->info(), choice);
  if (!plan_result) return fail(plan_result.error());

  common::LiveLine line("jostle play");
  for (const std::string& text : findings) line.say("{}", text);
  tell_what_is_left_out(*plan_result, arguments.verbose, line);
  auto player_result = Player::create(std::move(*reader_result), *plan_result, std::move(options), line);
  if (!player_result) return fail(player_result.error());
  PlayReport report;
  {
    Keyboard keyboard;
    report = (*player_result)->run(keyboard, stop);
  }
  if (report.problem) line.say("{}", report.problem->message);
  if (report.refused > 0) line.say("the middleware had no room for {} messages", report.refused);
  line.say("{}: {} messages of {} topics in {:.1f} s; late by {:.3f} ms (median), {:.3f} ms (p99), {:.3f} ms (worst)",
           report.problem ? "ended" : report.reason, report.sent, report.messages.size(), report.seconds,
           milliseconds(report.lateness.quantile(0.5)), milliseconds(report.lateness.quantile(0.99)),
           milliseconds(report.lateness.worst()));
  if (!arguments.json.empty()) {
    if (auto ok = common::write_text(arguments.json, to_json(report, arguments.bag).dump(2) + "\n"); !ok) {
      line.say("{}", ok.error().message);
      return common::kExitBroken;
    }
  }
  if (report.problem) return exit_code(*report.problem);
  return stop.stop_requested() ? common::kExitInterrupted : common::kExitOk;
}

int control(const Arguments& arguments, const RemoteOptions& options, std::stop_token stop) {
  std::vector<Control> controls;
  for (const std::string& text : arguments.controls) {
    if (text == "status") continue;  // shown anyway
    auto control_result = parse_control(text);
    if (!control_result) return fail({control_result.error().code, control_result.error().message + ", or status"});
    controls.push_back(std::move(*control_result));
  }
  const auto status_result = control_remotely(controls, options, std::move(stop));
  if (!status_result) return fail(status_result.error());
  const auto& status = *status_result;
  const nlohmann::json json{
      {"bag", status.bag()},       {"state", status.state()},      {"paused", status.paused()},
      {"loop", status.loop()},     {"rate", status.rate()},        {"time", status.time()},
      {"start", status.start()},   {"end", status.end()},          {"bag_time", status.bag_time()},
      {"passes", status.passes()}, {"messages", status.messages()}};
  fmt::print("{}\n", json.dump());
  return common::kExitOk;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Publishes a bag's messages as they were recorded, with the spacing they had.", "jostle play");
  Arguments arguments;
  PlayerOptions options;
  common::ProcessOptions process;
  auto* bag = app.add_option("bag", arguments.bag, "Folder of a bag, or one of its files");
  app.add_option("topics", arguments.topics,
                 "Globs of topics, such as '/robot/*'; * goes past slashes (default: all). Topics on\n"
                 "which somebody acts, such as /robot/command, only if one names them in full");
  app.add_option("--exclude", arguments.excluded, "Globs of topics to leave out");
  app.add_option("--remap", arguments.remaps, "/FROM:=/TO: play a topic under another name; may be given again");
  app.add_option("--rate", options.playback.rate, "Seconds of the bag per second")
      ->capture_default_str()
      ->check(CLI::Range(kSlowestRate, kFastestRate));
  app.add_option("--start", arguments.start, "Begin so many seconds after the first message")
      ->check(CLI::Range(0.0, kMostSeconds));
  auto* duration = app.add_option("--duration", arguments.duration, "End after so many seconds of the bag")
                       ->check(CLI::Range(1e-9, kMostSeconds));
  app.add_flag("--loop", options.playback.loop, "Begin again at the end");
  app.add_flag("--paused", options.playback.paused, "Wait to be resumed");
  auto* clock =
      app.add_option("--clock", options.clock, "Publish the bag's time on /clock, so often per second (default: 100)")
          ->expected(0, 1)
          ->check(CLI::Range(0.1, 1000.0));
  auto* subscribers = app.add_option("--wait-for-subscribers", options.subscribers,
                                     "Begin once every topic has so many subscribers (default: 1)")
                          ->expected(0, 1)
                          ->check(CLI::Range(1, 1000));
  app.add_option("--timeout", arguments.timeout, "Longest wait in seconds, for subscribers or for what --control asks")
      ->capture_default_str()
      ->check(CLI::Range(0.0, kMostSeconds));
  auto* controls =
      app.add_option("--control", arguments.controls,
                     "Tell the playback of this domain what to do, one after the other, and show its state:\n"
                     "pause, resume, toggle, step, seek:SECONDS, rate:FACTOR, loop:0, loop:1, quit, status")
          ->expected(1, -1)
          ->excludes(bag);
  app.add_flag("-v,--verbose", arguments.verbose, "Say also what is sent again after a seek");
  app.add_option("--json", arguments.json, "File for what was played, and how punctually");
  common::add_process_options(app, process);
  app.footer(
      fmt::format("Keys: {}.\nExit codes: 0 played, 2 bad input or a damaged bag, 3 a part of the system failed, "
                  "130 interrupted.",
                  kKeyHelp));
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  if (*clock && clock->results().front().empty()) options.clock = 100.0;
  if (*subscribers && subscribers->results().front().empty()) options.subscribers = 1;
  if (!*bag && !*controls)
    return fail({Code::kInvalidArgument, "got no bag, wanted one, or --control; `jostle play --help` says more"});
  if (auto ok = common::check_outputs({{.option = "--json", .path = arguments.json, .endings = {}}}); !ok) {
    fmt::print(stderr, "jostle play: {}\n", ok.error().message);
    return common::exit_code_of(ok.error());
  }
  common::die_with_parent(process.parent);
  const common::StopSignal signal;
  options.domain = process.domain;
  options.timeout = from_seconds(arguments.timeout);
  options.playback.start = from_seconds(arguments.start);
  if (*duration) options.playback.duration = from_seconds(arguments.duration);
  try {
    if (*controls) return control(arguments, {.domain = options.domain, .timeout = options.timeout}, signal.token());
    return play(arguments, std::move(options), signal.token());
  } catch (const std::exception& error) {  // the middleware's SetupError, no memory
    fmt::print(stderr, "jostle play: {}\n", error.what());
    return common::kExitBroken;
  }
}
