#pragma once
/// \file
/// Poses, one after the other, to readings with velocities.

#include <array>
#include <map>
#include <string>
#include <vector>

#include "perception/api/object_source.hpp"

namespace jostle::perception {

/// A Tracker keeps the newest measurement of each object, as it came: nothing is filtered. Velocities are differences
/// of two measurements; 0 where those are more than kLongestGap apart, or were made at the same time. What is not
/// measured any more stays where it was, at rest.
///
/// Threads  one at a time.
class Tracker {
 public:
  static constexpr double kLongestGap = 0.2;  ///< s

  /// Takes a measurement of X_WB made at `time`, s. `orientation`: w, x, y, z, normalised here. One that is older than
  /// the newest of its object, or has no rotation, is dropped; returns whether it was taken.
  bool take(const std::string& name, const std::array<double, 3>& position, const std::array<double, 4>& orientation,
            double time);

  /// Returns every object that was ever measured, by its name, as it is known at `time`, s.
  std::vector<ObjectReading> readings(double time) const;

 private:
  struct Track {
    ObjectReading reading;
    double time = 0.0;  // s, of the measurement
  };
  std::map<std::string, Track> tracks_;
};

}  // namespace jostle::perception
