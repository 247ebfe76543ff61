#pragma once
/// \file
/// Time as the rooms write it.

#include <chrono>

namespace jostle {

using TimePoint = std::chrono::steady_clock::time_point;

/// Returns a duration as a plain number, s.
inline double seconds(std::chrono::nanoseconds time) { return std::chrono::duration<double>(time).count(); }

}  // namespace jostle
