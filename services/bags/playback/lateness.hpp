#pragma once
/// \file
/// Lateness: how punctual a playback is, in memory that does not grow with it.

#include <array>
#include <chrono>
#include <cstdint>

namespace jostle::bags {

/// Counts delays in bins that are 2 % wide, from 1 us to over 100 s.
class Lateness {
 public:
  void add(std::chrono::nanoseconds delay);

  std::uint64_t count() const { return count_; }
  std::chrono::nanoseconds worst() const { return worst_; }  ///< exact
  /// Returns a delay that a fraction p in [0, 1] of the delays does not exceed, up to 2 % too long; 0 without any.
  std::chrono::nanoseconds quantile(double p) const;

 private:
  std::array<std::uint64_t, 1024> bins_{};
  std::uint64_t count_ = 0;
  std::chrono::nanoseconds worst_{0};
};

}  // namespace jostle::bags
