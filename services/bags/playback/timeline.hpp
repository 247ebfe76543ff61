#pragma once
/// \file
/// Timeline: which moment of a bag belongs to a moment of the steady clock.

#include <chrono>

#include "idl/types/time.hpp"
#include "services/bags/format/message.hpp"

namespace jostle::bags {

/// A clock that shows bag time, stands or runs, and can be set.
///
///   at(t) = at(t0) + rate * (t - t0)       t0: when it was last set, started or changed
///
/// Reads no clock itself: every call says what time it is. Threads  one.
class Timeline {
 public:
  /// Stands at `moment`. `rate`: seconds of the bag per second, > 0.
  Timeline(Time moment, double rate) : moment_(moment), rate_(rate) {}

  Time at(TimePoint now) const;

  /// When a moment of the bag is reached, or was. TimePoint::max() for a moment ahead
  /// while the clock stands, and for one that is more than a century away.
  TimePoint when(Time moment) const;

  void set(Time moment, TimePoint now);
  void set_rate(double rate, TimePoint now);
  void run(TimePoint now);
  void stand(TimePoint now);

  bool runs() const { return runs_; }
  double rate() const { return rate_; }

 private:
  Time moment_;  // at since_, or for as long as it stands
  double rate_;
  bool runs_ = false;
  TimePoint since_{};
};

}  // namespace jostle::bags
