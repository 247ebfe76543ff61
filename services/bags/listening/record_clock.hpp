#pragma once
/// \file
/// RecordClock: log times that go on evenly, whatever is done to the wall clock.

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>

#include "services/bags/format/message.hpp"

namespace jostle::bags {

/// A RecordClock shows the wall clock's time when it was made, and from then on what has elapsed. It follows a wall
/// clock that is slewed, by half a thousandth at most, and not one that is set: the differences of log times are true.
///
/// Threads  at() from any, look() from one.
class RecordClock {
 public:
  using Moment = std::chrono::steady_clock::time_point;

  RecordClock(Time wall, Moment now) : offset_(wall - count(now)), looked_(now) {}
  RecordClock() : RecordClock(wall(), std::chrono::steady_clock::now()) {}

  Time at(Moment now) const { return offset_.load() + count(now); }

  /// Compares with the wall clock. Returns by how much that was set since the last look; 0 if it was not.
  std::chrono::nanoseconds look(Time wall, Moment now) {
    constexpr std::int64_t kStep = 50'000'000;  // ns; what a busy machine takes between two clocks is less
    constexpr double kSlew = 500e-6;            // as the kernel slews
    const std::int64_t ahead = wall - at(now) - set_by_;
    const auto most = static_cast<std::int64_t>(kSlew * static_cast<double>((now - looked_).count()));
    looked_ = now;
    if (ahead <= -kStep || ahead >= kStep) {
      set_by_ += ahead;
      return std::chrono::nanoseconds(ahead);
    }
    offset_ += std::clamp(ahead, -most, most);
    return {};
  }

  /// Does so now. A look that was interrupted between the two clocks counts for nothing.
  std::chrono::nanoseconds look() {
    constexpr std::chrono::milliseconds kInterrupted{5};
    const Moment before = std::chrono::steady_clock::now();
    const Time wall_now = wall();
    const Moment after = std::chrono::steady_clock::now();
    return after - before > kInterrupted ? std::chrono::nanoseconds{} : look(wall_now, before);
  }

  /// By how much the wall clock was set, all in all.
  std::chrono::nanoseconds set_by() const { return std::chrono::nanoseconds(set_by_); }

 private:
  static Time wall() {
    const std::chrono::nanoseconds now = std::chrono::system_clock::now().time_since_epoch();
    return now.count();
  }
  static std::int64_t count(Moment now) {
    return std::chrono::duration_cast<std::chrono::nanoseconds>(now.time_since_epoch()).count();
  }

  std::atomic<std::int64_t> offset_;  // ns from the steady clock to log times
  Moment looked_;
  std::int64_t set_by_ = 0;  // ns
};

}  // namespace jostle::bags
