#include "services/common/process/standard_streams.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>

#include "services/common/process/exit_codes.hpp"
#include "services/common/process/program.hpp"

namespace jostle::common {
namespace {

// One of the two: a descriptor, and why it could not be written to first of all, or 0.
struct Stream {
  int descriptor;
  std::atomic<int> problem = 0;    // an errno
  std::FILE* unguarded = nullptr;  // what std::cout, and libraries that took it earlier, still write to
};
Stream output{STDOUT_FILENO}, errors{STDERR_FILENO};

std::string& speaker() {
  static auto* name = new std::string;  // for as long as the process lives, its end included
  return *name;
}

bool put(int descriptor, const char* bytes, std::size_t count) {
  while (count > 0) {
    const ssize_t done = ::write(descriptor, bytes, count);
    if (done >= 0) {
      bytes += done;
      count -= static_cast<std::size_t>(done);
    } else if (errno == EAGAIN) {  // somebody who shares it made it so
      pollfd writable{.fd = descriptor, .events = POLLOUT, .revents = 0};
      ::poll(&writable, 1, -1);
    } else if (errno != EINTR) {
      return false;
    }
  }
  return true;
}

// What stdio calls. It is told that all went well: a line that nobody reads is no reason to fail in the middle of
// something, and fmt would throw.
ssize_t write_stream(void* cookie, const char* bytes, std::size_t count) {
  Stream& stream = *static_cast<Stream*>(cookie);
  if (stream.problem == 0 && !put(stream.descriptor, bytes, count)) {
    stream.problem = errno;
    if (&stream == &output || stream.problem == EPIPE) request_stop();
  }
  return static_cast<ssize_t>(count);
}

// As the C library makes them: by lines on a terminal, at once for errors.
void replace(std::FILE*& standard, Stream& stream, int buffering) {
  std::fflush(standard);
  std::FILE* guarded =
      fopencookie(&stream, "w", {.read = nullptr, .write = write_stream, .seek = nullptr, .close = nullptr});
  if (!guarded) return;  // no memory: then it stays what it was
  std::setvbuf(guarded, nullptr, buffering, BUFSIZ);
  stream.unguarded = standard;
  standard = guarded;
}

// Descriptors 0 to 2 that are closed are opened the wrong way round: used, they still say EBADF.
void fill_gaps() {
  for (int descriptor = STDIN_FILENO; descriptor <= STDERR_FILENO; ++descriptor) {
    if (::fcntl(descriptor, F_GETFD) < 0 && errno == EBADF)
      (void)::open("/dev/null", descriptor == STDIN_FILENO ? O_WRONLY : O_RDONLY);  // takes the lowest number
  }
}

// At the end of main, or in exit(): as coreutils' close_stdout.
void finish() {
  std::fflush(stdout);
  errno = EIO;
  if (output.unguarded && (std::fflush(output.unguarded) != 0 || std::ferror(output.unguarded)) && output.problem == 0)
    output.problem = errno;
  if (output.problem == 0) return;
  const std::string words =
      fmt::format("{}: standard output: cannot be written: {}\n", speaker(), std::strerror(output.problem));
  put(STDERR_FILENO, words.data(), words.size());
  ::_exit(kExitBroken);
}

}  // namespace

void guard_standard_streams(const std::string& program) {
  const bool is_first = speaker().empty();
  speaker() = program;
  if (!is_first) return;
  fill_gaps();
  std::signal(SIGPIPE, SIG_IGN);
  replace(stdout, output, isatty(STDOUT_FILENO) == 1 ? _IOLBF : _IOFBF);
  replace(stderr, errors, _IONBF);
  std::atexit(finish);
}

}  // namespace jostle::common
