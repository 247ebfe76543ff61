#pragma once
/// \file
/// Our programs as a user starts them: arguments in, exit code and words out.

#include <fcntl.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "tests/support/soon.hpp"
#include "tests/support/temp_folder.hpp"

namespace jostle::tests {

/// One process as /proc shows it.
struct ProcessEntry {
  pid_t pid = -1;
  pid_t parent = -1;
  char state = 'Z';     // proc(5): R runs, S sleeps, T stopped, Z ended
  std::string program;  // file name of what it runs; empty if it ended
};

/// Nothing if there is no such process.
inline std::optional<ProcessEntry> process_entry(pid_t pid) {
  const std::filesystem::path folder = std::filesystem::path("/proc") / std::to_string(pid);
  const std::string stat = contents(folder / "stat");
  const std::size_t name_end = stat.rfind(')');  // the name may hold anything
  if (name_end == std::string::npos) return {};
  ProcessEntry entry{.pid = pid};
  std::istringstream fields(stat.substr(name_end + 1));
  fields >> entry.state >> entry.parent;
  std::error_code gone;
  entry.program = std::filesystem::read_symlink(folder / "exe", gone).filename();
  return entry;
}

/// Ended ones that nobody waited for included.
inline std::vector<ProcessEntry> children_of(pid_t parent) {
  std::vector<ProcessEntry> children;
  std::error_code gone;
  for (const auto& folder : std::filesystem::directory_iterator("/proc", gone)) {
    const std::string name = folder.path().filename();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    const auto entry = process_entry(std::stoi(name));
    if (entry && entry->parent == parent) children.push_back(*entry);
  }
  return children;
}

/// Whether it runs, or could go on: one that ended and waits for its parent to
/// notice does not.
inline bool lives(pid_t pid) {
  const auto entry = process_entry(pid);
  return entry && entry->state != 'Z' && entry->state != 'X';
}

/// The most memory a process had at a time, MB; 0 if it is gone.
inline std::size_t peak_memory(pid_t pid) {
  std::istringstream lines(contents(std::filesystem::path("/proc") / std::to_string(pid) / "status"));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("VmHWM:")) return std::stoul(line.substr(6)) >> 10;
  }
  return 0;
}

/// Processor time a process has used so far, in seconds.
inline double processor_time(pid_t pid) {
  const std::string stat = contents(std::filesystem::path("/proc") / std::to_string(pid) / "stat");
  std::istringstream fields(stat.substr(std::min(stat.size(), stat.rfind(')') + 1)));
  std::string skipped;
  for (int i = 3; i < 14; ++i) fields >> skipped;  // proc(5): 14 and 15 are utime and stime
  double user = 0.0, system = 0.0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

/// One of our programs, its output kept. At the end of its scope it and every
/// child it was seen to have are killed.
class ProgramProcess {
 public:
  using Environment = std::map<std::string, std::string>;

  /// `name` such as "jostle_run" beside the others; `folder` takes the output.
  ProgramProcess(const std::string& name, std::vector<std::string> arguments, const TempFolder& folder,
                 Environment environment = {})
      : out_(output_file(folder, name, "out")), err_(output_file(folder, name, "err")) {
    const std::filesystem::path program = std::filesystem::path(JOSTLE_PROGRAMS) / name;
    arguments.insert(arguments.begin(), program);
    std::vector<std::string> variables;
    for (char** variable = environ; *variable; ++variable) {
      const std::string text = *variable;
      if (!environment.contains(text.substr(0, text.find('=')))) variables.push_back(text);
    }
    for (const auto& [key, value] : environment) variables.push_back(key + "=" + value);

    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, out_.c_str(), O_WRONLY | O_CREAT, 0644);
    posix_spawn_file_actions_addopen(&files, STDERR_FILENO, err_.c_str(), O_WRONLY | O_CREAT, 0644);
    const int problem =
        posix_spawn(&pid_, program.c_str(), &files, nullptr, pointers(arguments).data(), pointers(variables).data());
    posix_spawn_file_actions_destroy(&files);
    if (problem != 0) throw std::runtime_error("cannot start " + program.string());
  }
  ~ProgramProcess() {
    children();
    if (!code_) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    for (const auto& [child, program] : seen_) {
      const auto entry = process_entry(child);
      if (entry && entry->program == program) kill(child, SIGKILL);
    }
  }
  ProgramProcess(const ProgramProcess&) = delete;
  ProgramProcess& operator=(const ProgramProcess&) = delete;

  pid_t pid() const { return pid_; }
  std::string out() const { return contents(out_); }
  std::string err() const { return contents(err_); }

  void signal(int number) const { kill(pid_, number); }

  /// Exit code as a shell gives it, 128 + n for signal n; nothing while it runs.
  std::optional<int> code() {
    int status = 0;
    if (!code_ && waitpid(pid_, &status, WNOHANG) == pid_) {
      code_ = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
    }
    return code_;
  }

  /// The same once it has ended.
  std::optional<int> wait(std::chrono::milliseconds patience) {
    soon(patience, [&] { return code().has_value(); });
    return code_;
  }

  bool says(const std::string& text, std::chrono::milliseconds patience) {
    return soon(patience, [&] { return err().find(text) != std::string::npos || code(); }) &&
           err().find(text) != std::string::npos;
  }

  /// Children that run our programs.
  std::vector<ProcessEntry> children() {
    std::vector<ProcessEntry> ours;
    if (code_) return ours;  // the process id may be another's by now
    for (const ProcessEntry& child : children_of(pid_)) {
      if (!child.program.starts_with("jostle_")) continue;
      seen_[child.pid] = child.program;
      ours.push_back(child);
    }
    return ours;
  }

  /// A child that runs a program, or -1.
  pid_t child(const std::string& program) {
    for (const ProcessEntry& entry : children()) {
      if (entry.program == program) return entry.pid;
    }
    return -1;
  }

  /// Of all children seen so far those that are still there.
  std::vector<std::string> left_over() const {
    std::vector<std::string> left;
    for (const auto& [child, program] : seen_) {
      const auto entry = process_entry(child);
      if (entry && lives(child) && entry->program == program) left.push_back(program);
    }
    return left;
  }

 private:
  static std::filesystem::path output_file(const TempFolder& folder, const std::string& name, const char* kind) {
    static int count = 0;
    return folder.path() / (name + "-" + std::to_string(count++) + "." + kind);
  }

  static std::vector<char*> pointers(std::vector<std::string>& texts) {
    std::vector<char*> result;
    for (std::string& text : texts) result.push_back(text.data());
    result.push_back(nullptr);
    return result;
  }

  std::filesystem::path out_, err_;
  pid_t pid_ = -1;
  std::optional<int> code_;
  std::map<pid_t, std::string> seen_;  // children, and what they run
};

}  // namespace jostle::tests
