#pragma once
/// \file
/// Waiting for what must happen.

#include <poll.h>

#include <chrono>
#include <functional>

namespace jostle::tests {

/// Whether a condition came true within `patience`. Pauses between two looks:
/// who looks all the time takes a core from what is waited for.
inline bool soon(std::chrono::milliseconds patience, const std::function<bool()>& condition) {
  constexpr int kPause = 5;  // ms, well below anything measured here
  const auto deadline = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() >= deadline) return false;
    poll(nullptr, 0, kPause);
  }
  return true;
}

}  // namespace jostle::tests
