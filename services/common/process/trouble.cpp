#include "services/common/process/trouble.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <utility>

namespace jostle::common {
namespace {

// Bytes of the UTF-8 character that begins here, 0 if there is none.
std::size_t character_at(std::string_view text, std::size_t at) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  const unsigned char first = byte(at);
  if (first < 0x80) return first >= 0x20 && first != 0x7f ? 1 : 0;
  const std::size_t size = first >= 0xf0 ? 4 : first >= 0xe0 ? 3 : first >= 0xc2 ? 2 : 0;
  if (size == 0 || first > 0xf4 || at + size > text.size()) return 0;
  for (std::size_t i = 1; i < size; ++i) {
    if ((byte(at + i) & 0xc0) != 0x80) return 0;
  }
  if (first == 0xc2 && byte(at + 1) < 0xa0) return 0;  // control characters of Latin 1
  return size;
}

// Where the program has set up its log; standard output is never the place.
void warn_line(const std::string& text) {
  if (spdlog::default_logger_raw()->name().empty()) {
    fmt::print(stderr, "warning: {}\n", text);
  } else {
    spdlog::warn("{}", text);
  }
}

}  // namespace

std::string shown(std::string_view text, std::size_t most) {
  std::string result;
  std::size_t at = 0;
  while (at < text.size() && at < most) {
    const std::size_t size = character_at(text, at);
    if (size > 0) {
      result += text.substr(at, size);
    } else {
      result += fmt::format("\\x{:02x}", static_cast<unsigned char>(text[at]));
    }
    at += std::max(size, std::size_t{1});
  }
  if (at < text.size()) result += fmt::format("... ({} bytes)", text.size());
  return result;
}

Trouble::~Trouble() {
  next_ = {};
  say();
}

void Trouble::say() {
  std::string line;
  {
    const std::lock_guard lock(mutex_);
    const auto now = std::chrono::steady_clock::now();
    if (unsaid_ == 0 || now < next_) return;
    next_ = now + pause_;
    line = std::exchange(first_, "");
    const std::uint64_t others = std::exchange(unsaid_, 0) - 1;
    if (others > 0) line += fmt::format(" (and {} more {} since the last such line)", others, cases_);
  }
  warn_line(line);
}

std::uint64_t Trouble::count() const {
  const std::lock_guard lock(mutex_);
  return count_;
}

}  // namespace jostle::common
