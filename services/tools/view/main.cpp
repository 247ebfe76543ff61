// jostle view: a run or a bag, in a browser or in Foxglove.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>

#include "services/common/process/command_line.hpp"
#include "services/common/process/files.hpp"
#include "services/common/process/program.hpp"
#include "services/common/process/random_id.hpp"
#include "services/tools/view/bag_source.hpp"
#include "services/tools/view/live_source.hpp"

namespace {

using namespace jostle;
using namespace jostle::tools;

struct Arguments {
  std::string bag, token_file;
  std::vector<std::string> topics, excluded, messages;
  bool paused = false;
};

void say(const std::string& text) { fmt::print(stderr, "jostle view: {}\n", text); }

int fail(const Error& error) {
  say(error.message);
  return common::exit_code_of(error);
}

bool is_loopback(const std::string& address) { return address.starts_with("127.") || address == "::1"; }

// A user's own, or one that is made up where others may connect.
Result<std::string> choose_token(const std::string& file, const std::string& address) {
  if (file.empty()) {
    return is_loopback(address) ? "" : fmt::format("{:016x}{:016x}", common::random_id(), common::random_id());
  }
  auto text_result = common::read_text(file);
  if (!text_result) return text_result.error();
  std::string token = text_result->substr(0, text_result->find_last_not_of(" \r\n") + 1);
  const bool is_plain = std::ranges::all_of(token, [](unsigned char c) { return std::isalnum(c) || c == '-'; });
  if (token.size() >= 16 && is_plain) return token;
  return invalid("--token-file " + file, fmt::format("{} characters", token.size()),
                 "at least 16 letters, digits and dashes");
}

int view(const Arguments& arguments, ViewServerOptions options, std::optional<int> domain, std::stop_token stop) {
  const bags::Selection selection{.topics = arguments.topics, .excluded = arguments.excluded};
  const auto messages_result = bags::message_files(arguments.messages);
  if (!messages_result) return fail(messages_result.error());
  std::unique_ptr<BagSource> bag;
  if (!arguments.bag.empty()) {
    auto bag_result = BagSource::open({.bag = arguments.bag,
                                       .selection = selection,
                                       .messages = *messages_result,
                                       .paused = arguments.paused,
                                       .on_warning = say});
    if (!bag_result) return fail(bag_result.error());
    bag = std::move(bag_result).value();
    options.name = fmt::format("jostle: {}", arguments.bag);
    options.has_playback = true;
  }
  LiveSource live({.domain = domain,
                   .selection = selection,
                   .messages = *messages_result,
                   .control = options.has_control,
                   .on_warning = say});
  const auto on_set = [&](const ViewParameters& wanted) { return bag ? bag->set(wanted) : live.set(wanted); };
  auto server_result = ViewServer::start(std::move(options), {.on_set = on_set});
  if (!server_result) return fail(server_result.error());
  ViewServer& server = **server_result;
  // Whoever started this program waits for the word "ready".
  const auto say_ready = [&](const std::string& what) { say(fmt::format("ready: {} at {}", what, server.url())); };
  if (bag) {
    say_ready(fmt::format("{} messages of {}", bag->info().messages, arguments.bag));
    bag->run(server, stop);
  } else {
    auto ok = live.run(server, stop, [&](int number) { say_ready(fmt::format("domain {}", number)); });
    if (!ok) return fail(ok.error());
  }
  const ViewServerCounts counts = server.counts();
  say(fmt::format("{} samples to viewers, {} dropped for slow ones", counts.samples_out, counts.dropped));
  return common::kExitOk;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Shows a run as it goes on, or a bag, to any number of viewers: a page in a browser, and Foxglove. It only\n"
      "listens: nothing that runs notices.",
      "jostle view");
  Arguments arguments;
  ViewServerOptions options;
  common::ProcessOptions process;
  auto* bag = app.add_option("bag", arguments.bag, "Folder of a bag, or one of its files (default: what is live)");
  app.add_option("--topics", arguments.topics,
                 "Globs of topics, such as '/robot/*'; * goes past slashes (default: all)");
  app.add_option("--exclude", arguments.excluded,
                 "Globs of topics to leave out (default: /pool/*, unless topics are given)");
  app.add_option("--messages", arguments.messages,
                 "Folder with .msg files of types of your own, FOLDER/pkg/msg/Name.msg; may be given again\n"
                 "(AMENT_PREFIX_PATH is looked through, too)")
      ->allow_extra_args(false);
  app.add_option("--port", options.port, "Port to listen at; 0: any")->capture_default_str()->check(common::port());
  app.add_option("--address", options.address,
                 "Address to listen at. Others than loopback have a token, which the address that is shown contains")
      ->capture_default_str();
  app.add_option("--token-file", arguments.token_file, "File with a token of your own, 16 characters or more");
  app.add_option("--allow-origin", options.origins,
                 "Let a page from elsewhere connect, such as https://app.foxglove.dev; may be given again");
  app.add_flag("--paused", arguments.paused, "Wait at the beginning of the bag")->needs(bag);
  app.add_flag("--control", options.has_control,
               "Let viewers cancel the goal that is at work, and nothing else. On a protected domain it takes an\n"
               "identity with the role robot")
      ->excludes(bag);
  common::add_process_options(app, process);
  app.footer(
      "docs/view.md says how Foxglove connects.\n"
      "Exit codes: 0 ended by a signal, 2 bad input or a damaged bag, 3 a part of the system failed.");
  if (const auto code = common::parse_arguments(app, argc, argv)) return *code;
  common::die_with_parent(process.parent);
  if (arguments.topics.empty() && arguments.excluded.empty()) arguments.excluded = {"/pool/*"};
  auto token_result = choose_token(arguments.token_file, options.address);
  if (!token_result) return fail(token_result.error());
  options.token = std::move(token_result).value();
  options.page = common::data_file("web");
  const common::StopSignal signal;
  try {
    return view(arguments, std::move(options), process.domain, signal.token());
  } catch (const std::exception& error) {  // no memory, no thread
    say(error.what());
    return common::kExitBroken;
  }
}
