#pragma once
/// \file
/// SourceClock: stamps of a sensor whose clock is not this host's.

#include <cmath>
#include <deque>

namespace jostle::perception {

/// A SourceClock puts stamps on this host's clock. How far the clocks are apart shows in how long messages seem to
/// take: the shortest of the newest ten seconds took next to no time. What that message took all the same, every stamp
/// is too late. Clocks that seem to be less than 0.2 s apart are taken to agree, as those of hosts with NTP do, and
/// stamps are left as they are.
///
/// Threads  one at a time.
class SourceClock {
 public:
  static constexpr double kWindow = 10.0;  ///< s
  static constexpr double kAgree = 0.2;    ///< s

  /// Returns when it was, s of this host's clock. `stamp`: s of the sensor's; `arrival`: s of this host's, in order.
  double to_host(double stamp, double arrival) {
    const double taken = arrival - stamp;
    while (!shortest_.empty() && shortest_.back().taken >= taken) shortest_.pop_back();
    shortest_.push_back({arrival, taken});
    while (shortest_.front().arrival < arrival - kWindow) shortest_.pop_front();
    const double apart = shortest_.front().taken;
    return std::abs(apart) < kAgree ? stamp : stamp + apart;
  }

 private:
  struct Message {
    double arrival, taken;  // s
  };
  std::deque<Message> shortest_;  // of the window: each took longer than those before it
};

}  // namespace jostle::perception
