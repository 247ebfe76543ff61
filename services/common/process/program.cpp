#include "services/common/process/program.hpp"

#include <fmt/format.h>
#include <pthread.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <unistd.h>
#include <cerrno>
#include <csignal>
#include <cstdlib>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <sstream>
#include <thread>
#include <utility>
#include <vector>

#include "idl/types/number.hpp"
#include "services/common/process/command_line.hpp"
#include "services/common/process/domain.hpp"
#include "services/common/process/environment.hpp"
#include "services/common/process/standard_streams.hpp"
#include "services/common/terminal/terminal.hpp"

namespace jostle::common {
namespace {

constexpr std::chrono::milliseconds kTogether{500};

std::stop_source& stop_source() {
  static std::stop_source source;
  return source;
}

sigset_t stop_signals() {
  sigset_t set;
  sigemptyset(&set);
  sigaddset(&set, SIGINT);
  sigaddset(&set, SIGTERM);
  struct sigaction hangup {};
  const bool is_ignored = sigaction(SIGHUP, nullptr, &hangup) == 0 && hangup.sa_handler == SIG_IGN;  // nohup
  if (!is_ignored) sigaddset(&set, SIGHUP);
  return set;
}

std::atomic<bool> has_stop_signal = false;

// What goes when the process ends all of a sudden.
struct Leftovers {
  std::mutex mutex;  // guards paths
  std::vector<std::filesystem::path> paths;
};

Leftovers& leftovers() {
  static auto* all = new Leftovers;  // never destroyed: a thread may need it until the very end
  return *all;
}

// On a thread of its own, which nothing that hangs can hold up.
void end_after(std::chrono::milliseconds patience) {
  std::this_thread::sleep_for(patience);
  const std::string line =
      fmt::format("{}: did not end within {:.1f} s of the signal, some thread hangs; ends at once\n",
                  program_invocation_short_name, static_cast<double>(patience.count()) / 1e3);
  [[maybe_unused]] const auto written = write(STDERR_FILENO, line.data(), line.size());
  if (const std::unique_lock lock(leftovers().mutex, std::try_to_lock); lock) {
    std::error_code ignored;
    for (const auto& path : leftovers().paths) std::filesystem::remove_all(path, ignored);
  }
  _exit(kExitBroken);
}

// Not an error: with few programs on a host it goes well most of the time.
void warn_of_ports(std::optional<int> wanted) {
  const auto domain_result = choose_domain(wanted);
  const auto trouble = domain_result ? port_trouble(*domain_result) : std::nullopt;
  if (trouble)
    fmt::print(stderr, "warning: DDS domain {}: {}; better: {}\n", *domain_result, trouble->finding, trouble->remedy);
}

// Without a minus and leading zeros, with which the parser would read octal numbers.
std::string decimal(std::string text) {
  const std::size_t sign = text.starts_with('-') ? 1 : 0;
  const std::size_t first = text.find_first_not_of('0', sign);
  text.erase(sign, std::min(first, text.size() - 1) - sign);
  return text;
}

std::string check_whole(std::string& text, bool is_signed) {
  const std::string plain(without_plus(text));
  const bool has_digits = plain.find_first_of("0123456789") != plain.npos;
  const std::size_t first = is_signed && plain.starts_with('-') ? 1 : 0;
  if (!has_digits || plain.find_first_not_of("0123456789", first) != plain.npos)
    return fmt::format("got '{}', wanted a whole number{}", text, is_signed ? "" : ", 0 or more");
  text = decimal(plain);
  return "";
}

std::string check_finite(std::string& text) {
  const std::string plain(without_plus(text));
  if (!parse_number(plain)) return fmt::format("got '{}', wanted a finite number", text);
  text = plain;
  return "";
}

std::string check_filled(std::string& text) { return text.empty() ? "got '', wanted a text" : ""; }

// Adds to every option of a program what its type alone asks for.
void check_values(CLI::App& app) {
  const auto checked = [](CLI::Option& option, const std::function<std::string(std::string&)>& check) {
    option.transform(CLI::Validator(check, ""));  // before the option's own checks; "": the help stays what it is
  };
  for (CLI::Option* option : app.get_options([](CLI::Option* o) { return o->get_items_expected_max() > 0; })) {
    const std::string type = option->get_type_name(), name = option->get_name();
    if (type.find("SIZE") != type.npos) continue;  // 12MB: whoever wants sizes reads them
    if (type.starts_with("UINT")) checked(*option, [](std::string& text) { return check_whole(text, false); });
    if (type.starts_with("INT")) checked(*option, [](std::string& text) { return check_whole(text, true); });
    if (type.starts_with("FLOAT")) checked(*option, check_finite);
    const bool may_be_empty = name == "--discovery" || name == "--namespace" || name == "--secure";
    if (type.starts_with("TEXT") && !may_be_empty) checked(*option, check_filled);
  }
  for (CLI::App* command : app.get_subcommands({})) check_values(*command);
}

}  // namespace

// Blocked in every thread and waited for in one: a stop request takes locks,
// which a signal handler must not.
StopSignal::StopSignal(std::chrono::milliseconds patience) {
  const sigset_t set = stop_signals();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  has_stop_signal = true;
  std::thread([set, patience] {
    int signal = 0;
    sigwait(&set, &signal);
    std::thread(end_after, patience).detach();
    stop_source().request_stop();
    // A second one ends a program that does not end by itself; not one that comes with the
    // first: timeout(1) sends its signal twice.
    std::this_thread::sleep_for(kTogether);
    const timespec at_once{};
    while (sigtimedwait(&set, nullptr, &at_once) > 0) {
    }
    sigset_t later = set;
    sigdelset(&later, SIGHUP);  // a session that closes sends it more than once
    pthread_sigmask(SIG_UNBLOCK, &later, nullptr);
    for (;;) pause();
  }).detach();
}

std::stop_token StopSignal::token() const { return stop_source().get_token(); }

void remove_at_abrupt_end(const std::filesystem::path& path) {
  const std::lock_guard lock(leftovers().mutex);
  leftovers().paths.push_back(path);
}

// By a signal, because whoever prints may hold a lock that a stop callback wants.
void request_stop() {
  if (has_stop_signal.exchange(false)) kill(getpid(), SIGTERM);
}

void wait_for(std::stop_token stop) { pause_until(std::chrono::steady_clock::time_point::max(), std::move(stop)); }

bool pause_until(std::chrono::steady_clock::time_point time, std::stop_token stop) {
  std::mutex unshared;
  std::condition_variable_any never;
  std::unique_lock lock(unshared);
  never.wait_until(lock, stop, time, [] { return false; });
  return !stop.stop_requested();
}

void die_with_parent(pid_t parent) {
  if (parent == 0) return;
  prctl(PR_SET_PDEATHSIG, SIGTERM);
  if (getppid() != parent) raise(SIGTERM);  // it ended before we asked
}

void add_network_options(CLI::App& app) {
  const auto sets = [](const char* variable) {
    return [variable](const std::string& text) { setenv(variable, text.c_str(), 1); };
  };
  auto* discovery = app.add_option_function<std::string>(
      "--discovery", sets("JOSTLE_DISCOVERY"),
      "How processes find each other: multicast, peers:HOST,HOST,...,\n"
      "server:HOST[:PORT] or localhost (default: JOSTLE_DISCOVERY, else what ROS 2's\n"
      "variables say, else multicast)");
  suggest(discovery, {"multicast", "peers:", "server:", "localhost"});
  auto* space = app.add_option_function<std::string>(
      "--namespace", sets("JOSTLE_NAMESPACE"),
      "ROS 2 namespace of the robot's topics, such as left: robots of different namespaces share\n"
      "a domain and its workers (default: JOSTLE_NAMESPACE, else none)");
  suggest(space, {});
  app.add_option_function<std::string>(
      "--secure", sets("JOSTLE_SECURE"),
      "Identity folder made by `jostle keys` (default: JOSTLE_SECURE, else unprotected)");
}

void add_process_options(CLI::App& app, ProcessOptions& options) {
  add_network_options(app);
  add_domain_options(app, options);
}

void add_domain_options(CLI::App& app, ProcessOptions& options) {
  app.add_option("--domain", options.domain, "DDS domain (default: ROS_DOMAIN_ID, else 0)");
  // For our own programs: no help shows it.
  app.add_option("--die-with-parent", options.parent, "Process id of the starter: end when it ends")->group("");
  app.parse_complete_callback([&options] {
    if (options.parent == 0) warn_of_ports(options.domain);  // else the parent has
  });
}

std::string participant_name(std::uint64_t id) { return fmt::format("participant {:016x}", id); }

namespace {

// What the launcher, the shell and the build ask of every program; no user does.
std::optional<int> answer(const CLI::App& app, const std::vector<std::string>& words) {
  if (words.empty()) return {};
  const std::vector<std::string> rest(words.begin() + 1, words.end());
  if (words[0] == "--help-of") {
    const auto help_result = help_of(app, rest);
    if (!help_result)
      fmt::print(stderr, "{}\n", help_result.error().message);
    else
      fmt::print("{}", *help_result);
    return help_result ? kExitOk : kExitUsage;
  }
  if (words[0] == "--complete") {
    for (const std::string& line : completions(app, rest)) fmt::print("{}\n", line);
    return kExitOk;
  }
  if (words[0] == "--man" && !rest.empty()) {
    fmt::print("{}", manual_page(app, rest[0]));
    return kExitOk;
  }
  return {};
}

// Whether what was asked for speaks DDS, and nobody else has told the user about the network.
bool tells_of_network(const CLI::App& app) {
  const auto* network = app.get_option_no_throw("--discovery");
  const auto* parent = app.get_option_no_throw("--die-with-parent");
  if (network && !(parent && parent->count() > 0)) return true;
  const auto chosen = app.get_subcommands();
  return std::ranges::any_of(chosen, [](const CLI::App* one) { return tells_of_network(*one); });
}

void tell_of_network(const CLI::App& app) {
  const auto choice_result = choose_network();
  if (!choice_result) return;  // whoever joins says so
  for (const std::string& line : network_news(*choice_result)) fmt::print(stderr, "{}: {}\n", app.get_name(), line);
}

}  // namespace

std::optional<int> parse_arguments(CLI::App& app, int argc, char** argv) {
  guard_standard_streams(app.get_name());
  document_exit_codes(app);
  if (const auto code = answer(app, {argv + 1, argv + argc})) return code;
  check_values(app);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& help) {
    std::ostringstream text;
    app.exit(help, text, text);
    fmt::print("{}", text.str());
    return kExitOk;
  } catch (const CLI::ParseError& error) {
    fmt::print(stderr, "{}\n", explain(app, error));
    return kExitUsage;
  }
  if (tells_of_network(app)) tell_of_network(app);
  return {};
}

void set_up_logging(const std::string& name) {
  const auto colours = shows_escape_codes(STDERR_FILENO) ? spdlog::color_mode::always : spdlog::color_mode::never;
  auto logger = spdlog::stderr_color_mt(name, colours);
  logger->set_pattern("%n: %^%l%$: %v");
  spdlog::set_default_logger(std::move(logger));
}

}  // namespace jostle::common
