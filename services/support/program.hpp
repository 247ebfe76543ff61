#pragma once
/// \file
/// What every program does the same way: ending on a signal, dying with its
/// parent, exit codes, logging.

#include <stop_token>
#include <string>

namespace jostle::services {

/// Exit codes of all programs.
enum ExitCode : int {
  kExitOk = 0,
  kExitFailed = 1,       ///< the work was done and failed
  kExitUsage = 2,        ///< wrong arguments or a bad file
  kExitBroken = 3,       ///< parts of the system failed
  kExitInterrupted = 130 ///< Ctrl-C
};

/// Turns SIGINT and SIGTERM into a stop request for the whole process. Make one
/// in main before any thread starts.
class StopSignal {
 public:
  StopSignal();
  StopSignal(const StopSignal&) = delete;
  StopSignal& operator=(const StopSignal&) = delete;

  std::stop_token token() const;
};

/// Ends this process when the one that started it ends, however it ends.
void die_with_parent();

/// Log lines go to standard error as "NAME: level: text".
void set_up_logging(const std::string& name);

}  // namespace jostle::services
