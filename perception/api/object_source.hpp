#pragma once
/// \file
/// ObjectSource: the port through which the world is seen.

#include <array>
#include <string>
#include <vector>

#include "idl/types/result.hpp"

namespace jostle::perception {

/// Pose X_WB and velocity of one object.
struct ObjectReading {
  std::string name;
  std::array<double, 3> position{};               ///< p_WoBo_W, m
  std::array<double, 4> orientation{1, 0, 0, 0};  ///< unit quaternion w, x, y, z
  std::array<double, 3> linear{};                 ///< m/s, world frame
  std::array<double, 3> angular{};                ///< rad/s, body frame
};

/// An ObjectSource measures where objects are: motion capture, cameras, or a simulated world.
///
/// Threads  one caller at a time.
/// Errors   kUnavailable      nothing heard for too long; says of what and since when
///          kInvalidArgument  a measurement that is not finite; says which field
class ObjectSource {
 public:
  virtual ~ObjectSource() = default;

  /// Returns the newest measurement of every object in view, in no particular order.
  virtual Result<std::vector<ObjectReading>> read() = 0;
};

}  // namespace jostle::perception
