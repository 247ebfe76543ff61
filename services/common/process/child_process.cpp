#include "services/common/process/child_process.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <fstream>
#include <iterator>
#include <sstream>
#include <thread>
#include <utility>

namespace jostle::common {
namespace {

constexpr std::chrono::seconds kPatience{2};
constexpr std::size_t kLastLines = 5;

// `status`: of waitpid(2).
ExitStatus from_system(int status) {
  if (WIFSIGNALED(status)) return {.signal = WTERMSIG(status)};
  return {.code = WEXITSTATUS(status)};
}

}  // namespace

std::string ExitStatus::text() const {
  if (signal > 0) return fmt::format("killed by signal {} ({})", signal, strsignal(signal));
  if (code >= 0) return fmt::format("exit code {}", code);
  return "nobody knows how";
}

Result<ChildProcess> ChildProcess::start(const std::filesystem::path& program,
                                         const std::vector<std::string>& arguments, const std::filesystem::path& log) {
  std::vector<std::string> words{program.string()};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);

  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_APPEND, 0644);
  posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t none;
  sigemptyset(&none);  // ours are blocked, see StopSignal
  posix_spawnattr_setsigmask(&attributes, &none);
  sigset_t ordinary;
  sigemptyset(&ordinary);
  sigaddset(&ordinary, SIGPIPE);  // ours is ignored, see guard_standard_streams
  posix_spawnattr_setsigdefault(&attributes, &ordinary);
  posix_spawnattr_setpgroup(&attributes, 0);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);

  pid_t pid = -1;
  const int problem = posix_spawn(&pid, program.c_str(), &files, &attributes, argv.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  posix_spawnattr_destroy(&attributes);
  if (problem != 0) {
    return Error{Code::kUnavailable,
                 fmt::format("{}: cannot be started: {}", program.string(), std::strerror(problem))};
  }
  return ChildProcess(pid, log);
}

ChildProcess::ChildProcess(ChildProcess&& other) noexcept
    : pid_(std::exchange(other.pid_, -1)), log_(std::move(other.log_)), ended_(other.ended_), told_(other.told_) {}

ChildProcess& ChildProcess::operator=(ChildProcess&& other) noexcept {
  end();
  pid_ = std::exchange(other.pid_, -1);
  log_ = std::move(other.log_);
  ended_ = other.ended_;
  told_ = other.told_;
  return *this;
}

ChildProcess::~ChildProcess() { end(); }

std::optional<ExitStatus> ChildProcess::reap(int options) {
  if (pid_ < 0 || ended_) return ended_;
  int status = 0;
  pid_t reaped = -1;
  do reaped = waitpid(pid_, &status, options);
  while (reaped < 0 && errno == EINTR);
  if (reaped == pid_) ended_ = from_system(status);
  if (reaped < 0) ended_ = ExitStatus{};  // somebody else waited for it: gone, and how is not known
  return ended_;
}

std::optional<ExitStatus> ChildProcess::ended() { return reap(WNOHANG); }

ExitStatus ChildProcess::wait() { return reap(0).value_or(ExitStatus{}); }

void ChildProcess::terminate() {
  if (pid_ > 0 && !ended()) {
    if (!told_) told_ = std::chrono::steady_clock::now();
    kill(pid_, SIGTERM);
    kill(pid_, SIGCONT);  // a stopped process takes no signal
  }
}

std::optional<ExitStatus> ChildProcess::wait_for(std::chrono::milliseconds patience) {
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (pid_ > 0 && !ended() && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  return ended_;
}

bool ChildProcess::has_said(const std::string& text) const {
  std::ifstream in(log_);
  const std::string said{std::istreambuf_iterator<char>(in), {}};
  return said.find(text) != std::string::npos;
}

void ChildProcess::end() {
  terminate();
  const auto waited = std::chrono::steady_clock::now() - told_.value_or(std::chrono::steady_clock::now());
  if (pid_ < 0 || wait_for(std::max(kPatience - std::chrono::duration_cast<std::chrono::milliseconds>(waited),
                                    std::chrono::milliseconds(0))))
    return;
  kill(pid_, SIGKILL);
  wait();
}

std::string ChildProcess::last_words() const {
  std::ifstream in(log_);
  std::deque<std::string> lines;
  for (std::string line; std::getline(in, line);) {
    lines.push_back(line);
    if (lines.size() > kLastLines) lines.pop_front();
  }
  std::string text;
  for (const std::string& line : lines) text += "  | " + line + "\n";
  return text;
}

std::string ChildProcess::last_line() const {
  std::ifstream in(log_);
  std::string last;
  for (std::string line; std::getline(in, line);) last = std::move(line);
  return last;
}

Result<void> run_tool(const std::string& name, const std::string& package, const std::vector<std::string>& arguments,
                      const std::filesystem::path& log) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const std::filesystem::path program = std::filesystem::path(folder) / name;
    if (access(program.c_str(), X_OK) != 0) continue;
    auto child_result = ChildProcess::start(program, arguments, log);
    if (!child_result) return child_result.error();
    const ExitStatus end = child_result->wait();
    if (end.ok()) return {};
    return Error{Code::kIo, fmt::format("{}: {}\n{}", name, end.text(), child_result->last_words())};
  }
  return Error{Code::kUnavailable, fmt::format("{}: not found on PATH; install the package {}", name, package)};
}

}  // namespace jostle::common
