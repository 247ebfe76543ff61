#pragma once
/// \file
/// The newest value of one thread for another, without waiting.

#include <array>
#include <atomic>
#include <cstdint>
#include <optional>

namespace jostle::robot_bridge {

/// A Mailbox holds the newest value that was put into it. Neither side waits for the other, locks or allocates.
///
/// Threads  one that puts, one that takes.
template <class T>
class Mailbox {
 public:
  void put(const T& value) {
    slots_[writing_] = value;
    writing_ = middle_.exchange(static_cast<std::uint8_t>(writing_ | kFresh)) & kIndex;
  }

  /// Returns the newest value, if one was put in since the last call.
  std::optional<T> take() {
    if ((middle_.load() & kFresh) == 0) return {};
    reading_ = middle_.exchange(reading_) & kIndex;
    return slots_[reading_];
  }

 private:
  static constexpr std::uint8_t kIndex = 3, kFresh = 4;
  std::array<T, 3> slots_{};
  std::atomic<std::uint8_t> middle_{1};
  std::uint8_t writing_ = 0, reading_ = 2;
};

}  // namespace jostle::robot_bridge
