#pragma once
/// \file
/// Programs that this one starts and looks after.

#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::common {

/// How a process ended. Programs are compared by `code` and `signal`; the text is for people.
struct ExitStatus {
  int code = -1;   ///< as exit(3) was given it; -1: a signal ended it, or nobody knows how it ended
  int signal = 0;  ///< the signal that ended it; 0: none

  bool ok() const { return code == 0; }
  std::string text() const;  ///< "exit code 1", "killed by signal 9 (Killed)"
  bool operator==(const ExitStatus&) const = default;
};

/// A running child. It has a process group of its own, so that Ctrl-C in the
/// terminal reaches only its parent; its output goes to a log file.
///
/// Destroying it ends the child: SIGTERM, and SIGKILL two seconds after the first one.
class ChildProcess {
 public:
  /// Error kUnavailable if the program cannot be started; names it.
  static Result<ChildProcess> start(const std::filesystem::path& program, const std::vector<std::string>& arguments,
                                    const std::filesystem::path& log);

  ChildProcess(ChildProcess&& other) noexcept;
  ChildProcess& operator=(ChildProcess&& other) noexcept;
  ~ChildProcess();

  pid_t pid() const { return pid_; }

  /// How it ended, or nothing while it runs.
  std::optional<ExitStatus> ended();

  /// Waits until it has ended, and says how.
  ExitStatus wait();

  /// Does the same, for so long at most; nothing if it still runs then.
  std::optional<ExitStatus> wait_for(std::chrono::milliseconds patience);

  /// Whether it has printed `text` so far.
  bool has_said(const std::string& text) const;

  /// Asks it to end, without waiting.
  void terminate();

  /// The last lines it printed, for an error message.
  std::string last_words() const;
  /// The last line it printed; empty before the first.
  std::string last_line() const;

 private:
  ChildProcess(pid_t pid, std::filesystem::path log) : pid_(pid), log_(std::move(log)) {}
  std::optional<ExitStatus> reap(int options);
  void end();

  pid_t pid_ = -1;  // -1: moved from, or seen to have ended
  std::filesystem::path log_;
  std::optional<ExitStatus> ended_;
  std::optional<std::chrono::steady_clock::time_point> told_;  // to end, for the first time
};

/// Runs a program of the system to its end; it writes to `log`.
/// Errors   kUnavailable  it is not on PATH; names the Debian package that has it
///          kIo           it failed; how, and its last words
Result<void> run_tool(const std::string& name, const std::string& package, const std::vector<std::string>& arguments,
                      const std::filesystem::path& log);

}  // namespace jostle::common
