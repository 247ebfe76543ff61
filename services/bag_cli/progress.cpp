#include "services/bag_cli/progress.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include "services/support/program.hpp"

namespace jostle::services {

Progress::Progress(std::string what, std::uint64_t total)
    : what_(std::move(what)),
      total_(total),
      is_terminal_(isatty(STDERR_FILENO) != 0),
      next_(std::chrono::steady_clock::now()) {}

Progress::~Progress() {
  if (is_shown_) fmt::print(stderr, "\r\033[K");
}

void Progress::show(std::uint64_t done) {
  constexpr std::uint64_t kLook = 1024;  // a look at the clock costs as much as a small message
  if (!is_terminal_ || done % kLook != 0) return;
  const auto now = std::chrono::steady_clock::now();
  if (now < next_) return;
  next_ = now + std::chrono::milliseconds(250);
  is_shown_ = true;
  fmt::print(stderr, "\r{}: {} of {} messages ({} %)\033[K", what_, done, total_,
             total_ == 0 ? 100 : done * 100 / total_);
}

int fail(const Error& error, int otherwise) {
  fmt::print(stderr, "jostle bag: {}\n", error.message);
  if (error.code == Code::kCancelled) return kExitInterrupted;
  return error.code == Code::kNotFound ? kExitUsage : otherwise;
}

}  // namespace jostle::services
