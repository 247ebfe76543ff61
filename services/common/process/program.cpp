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
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "services/common/process/domain.hpp"

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
  return set;
}

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

}  // namespace

// Blocked in every thread and waited for in one: a stop request takes locks,
// which a signal handler must not.
StopSignal::StopSignal(std::chrono::milliseconds patience) {
  const sigset_t set = stop_signals();
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
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
    pthread_sigmask(SIG_UNBLOCK, &set, nullptr);
    for (;;) pause();
  }).detach();
}

std::stop_token StopSignal::token() const { return stop_source().get_token(); }

void remove_at_abrupt_end(const std::filesystem::path& path) {
  const std::lock_guard lock(leftovers().mutex);
  leftovers().paths.push_back(path);
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
  app.add_option_function<std::string>("--discovery", sets("JOSTLE_DISCOVERY"),
                                       "How processes find each other: multicast, peers:HOST,HOST,... or\n"
                                       "server:HOST[:PORT] (default: JOSTLE_DISCOVERY, else multicast)");
  app.add_option_function<std::string>(
      "--namespace", sets("JOSTLE_NAMESPACE"),
      "Of the robot's topics, such as left: several robots then share a domain and its\n"
      "workers (default: JOSTLE_NAMESPACE, else none)");
  app.add_option_function<std::string>(
      "--secure", sets("JOSTLE_SECURE"),
      "Identity folder made by `jostle keys` (default: JOSTLE_SECURE, else unprotected)");
}

void add_process_options(CLI::App& app, ProcessOptions& options) {
  add_network_options(app);
  app.add_option("--domain", options.domain, "DDS domain (default: ROS_DOMAIN_ID, else 0)");
  app.add_option("--die-with-parent", options.parent, "Process id of the starter: end when it ends");
  app.parse_complete_callback([&options] {
    if (options.parent == 0) warn_of_ports(options.domain);  // else the parent has
  });
}

std::string participant_name(std::uint64_t id) { return fmt::format("participant {:016x}", id); }

std::optional<int> parse_arguments(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
    return {};
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? kExitOk : kExitUsage;
  }
}

void set_up_logging(const std::string& name) {
  auto logger = spdlog::stderr_color_mt(name);
  logger->set_pattern("%n: %^%l%$: %v");
  spdlog::set_default_logger(std::move(logger));
}

}  // namespace jostle::common
