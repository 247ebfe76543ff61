#pragma once
/// \file
/// One of our programs in a terminal of its own.

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <stdlib.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "tests/support/program_process.hpp"

namespace jostle::tests {

/// Typed at through type(), seen through screen(). Killed at the end of its scope.
class TerminalProcess {
 public:
  /// `kind`: the terminal's, as TERM names it.
  TerminalProcess(const std::string& name, std::vector<std::string> arguments, unsigned short columns = 120,
                  const std::string& kind = "xterm")
      : master_(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
    if (master_ < 0 || grantpt(master_) != 0 || unlockpt(master_) != 0) throw std::runtime_error("no pseudo-terminal");
    const std::string slave = ptsname(master_);
    // Held open: a terminal forgets its settings with its last user.
    slave_ = open(slave.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC);
    const winsize size{.ws_row = 24, .ws_col = columns, .ws_xpixel = 0, .ws_ypixel = 0};
    ioctl(slave_, TIOCSWINSZ, &size);

    const std::filesystem::path program = std::filesystem::path(JOSTLE_PROGRAMS) / name;
    arguments.insert(arguments.begin(), program);
    std::vector<char*> words;
    for (std::string& argument : arguments) words.push_back(argument.data());
    words.push_back(nullptr);
    std::string term = "TERM=" + kind;
    std::vector<char*> variables{term.data()};
    for (char** variable = environ; *variable; ++variable) {
      if (!std::string_view(*variable).starts_with("TERM=")) variables.push_back(*variable);
    }
    variables.push_back(nullptr);
    posix_spawn_file_actions_t files;
    posix_spawn_file_actions_init(&files);
    posix_spawn_file_actions_addopen(&files, STDIN_FILENO, slave.c_str(), O_RDWR, 0);  // becomes its controlling one
    posix_spawn_file_actions_adddup2(&files, STDIN_FILENO, STDOUT_FILENO);
    posix_spawn_file_actions_adddup2(&files, STDIN_FILENO, STDERR_FILENO);
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSID);
    const int problem = posix_spawn(&pid_, program.c_str(), &files, &attributes, words.data(), variables.data());
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&files);
    if (problem != 0) throw std::runtime_error("cannot start " + program.string());
  }
  ~TerminalProcess() {
    if (!code_) {
      kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    close(slave_);
    close(master_);
  }
  TerminalProcess(const TerminalProcess&) = delete;
  TerminalProcess& operator=(const TerminalProcess&) = delete;

  void type(const std::string& keys) const {
    if (write(master_, keys.data(), keys.size()) != static_cast<ssize_t>(keys.size()))
      throw std::runtime_error("cannot type");
  }
  void signal(int number) const { kill(pid_, number); }

  /// Everything that was printed so far.
  const std::string& screen() {
    pollfd readable{.fd = master_, .events = POLLIN, .revents = 0};
    while (poll(&readable, 1, 0) > 0 && (readable.revents & POLLIN) != 0) {
      char bytes[4096];
      const ssize_t count = read(master_, bytes, sizeof bytes);
      if (count <= 0) break;
      screen_.append(bytes, static_cast<std::size_t>(count));
    }
    return screen_;
  }
  bool shows(const std::string& text, std::chrono::milliseconds patience) {
    return soon(patience, [&] { return screen().find(text) != std::string::npos; });
  }

  /// Whether a line is handed over when it is complete, and echoed: as a shell has it.
  bool is_plain() const {
    termios settings{};
    tcgetattr(slave_, &settings);
    return (settings.c_lflag & ICANON) != 0 && (settings.c_lflag & ECHO) != 0 && (settings.c_iflag & IXON) != 0 &&
           settings.c_cc[VSUSP] != _POSIX_VDISABLE;
  }

  /// As ProgramProcess::wait.
  std::optional<int> wait(std::chrono::milliseconds patience) {
    soon(patience, [&] {
      screen();  // it would not end while nobody reads
      int status = 0;
      if (!code_ && waitpid(pid_, &status, WNOHANG) == pid_)
        code_ = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
      return code_.has_value();
    });
    return code_;
  }

 private:
  int master_ = -1, slave_ = -1;
  pid_t pid_ = -1;
  std::optional<int> code_;
  std::string screen_;
};

}  // namespace jostle::tests
