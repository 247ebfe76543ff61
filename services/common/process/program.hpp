#pragma once
/// \file
/// What every program does the same way: ending on a signal, dying with its
/// parent, exit codes, logging.

#include <sys/types.h>

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <stop_token>
#include <string>

#include "services/common/process/exit_codes.hpp"

namespace CLI {
class App;
}

namespace jostle::common {

/// Turns SIGINT, SIGTERM and SIGHUP (a terminal or ssh session that was closed; not under nohup) into a stop request
/// for the whole process. Another one, half a second later or more, ends it on the spot. Make one in main before any
/// thread starts.
///
/// A program that has not ended `patience` after the signal, because a thread hangs, says so, removes its temporary
/// folders and ends with kExitBroken.
class StopSignal {
 public:
  static constexpr std::chrono::milliseconds kPatience{4500};

  explicit StopSignal(std::chrono::milliseconds patience = kPatience);
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  std::stop_token token() const;
};

/// Has a file or folder removed if the process does not end in an orderly way after a StopSignal.
void remove_at_abrupt_end(const std::filesystem::path& path);

/// Stops this process as SIGTERM does, once, if it has made a StopSignal; else does nothing. Threads  any.
void request_stop();

/// Returns once a stop was requested.
void wait_for(std::stop_token stop);

/// Waits until `time`, or until a stop is requested; returns whether the time came.
bool pause_until(std::chrono::steady_clock::time_point time, std::stop_token stop);

/// Ends this process when the one that started it ends, however it ends; at once
/// if that has happened already. `parent`: its process id; 0 does nothing.
void die_with_parent(pid_t parent);

/// Adds --discovery, --namespace and --secure, which every program that speaks DDS has. They set JOSTLE_DISCOVERY,
/// JOSTLE_NAMESPACE and JOSTLE_SECURE of this process: so whatever it starts joins in the same way.
void add_network_options(CLI::App& app);

/// What every process of a run can be told, add_network_options() included.
struct ProcessOptions {
  std::optional<int> domain;  ///< DDS domain; else ROS_DOMAIN_ID, else 0
  pid_t parent = 0;           ///< see die_with_parent
};
void add_process_options(CLI::App& app, ProcessOptions& options);
/// Adds what they can be told of the domain alone: for one that neither looks for others nor says anything.
void add_domain_options(CLI::App& app, ProcessOptions& options);

/// Writes "participant 00000000deadbeef": how a process says in its log who it is in a domain, for the one
/// that started it. `id`: wire::Participant::id().
std::string participant_name(std::uint64_t id);

/// Parses the command line, after guard_standard_streams(). Numbers are decimal and finite in every program, and only
/// numbers that may be below zero have a minus; texts are not empty, but for --discovery, --namespace and --secure,
/// where that means none. Returns an exit code if the program is to end: after --help, or with kExitUsage after wrong
/// arguments, which it explains. Says in a line what in the environment decides how processes find each other, where a
/// user may not expect it. Three first words are not for users and in no help:
///
///   --help-of [SUBCOMMAND…]   the help of a subcommand; for `jostle help`
///   --complete WORD…          see completions(); for shells
///   --man PURPOSE             see manual_page(); for the build
std::optional<int> parse_arguments(CLI::App& app, int argc, char** argv);

/// Sends log lines to standard error, as "NAME: level: text"; in colour where a terminal shows it.
void set_up_logging(const std::string& name);

}  // namespace jostle::common
