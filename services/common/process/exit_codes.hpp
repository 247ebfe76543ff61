#pragma once
/// \file
/// The one table of exit codes.

#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::common {

/// Exit codes of all programs. The same kind of failure has the same code everywhere.
enum ExitCode : int {
  kExitOk = 0,
  kExitFailed = 1,        ///< the work was done, and its answer is no: not grasped, damaged, not equal
  kExitUsage = 2,         ///< wrong arguments, or an input that cannot be used
  kExitBroken = 3,        ///< the environment failed, an output cannot be written, or other processes are gone
  kExitInterrupted = 130  ///< told to stop: Ctrl-C, SIGTERM, a terminal or a pipe that was closed
};

/// Returns the code that goes with an error: kUsage for what was asked for, kFailed where time ran out, kInterrupted
/// where somebody wanted it, kBroken for everything that is nobody's request.
ExitCode exit_code_of(const Error& error);

struct ExitCodeMeaning {
  ExitCode code;
  std::string meaning;
};

/// Returns the table in rising order. `done` and `failed` say what 0 and 1 mean for one program.
std::vector<ExitCodeMeaning> exit_codes(const std::string& done = "done",
                                        const std::string& failed = "the task failed");

/// Writes the table as a sentence for a help text: "Exit codes: 0 done, 1 …".
std::string exit_codes_help(const std::string& done = "done", const std::string& failed = "the task failed");

}  // namespace jostle::common
