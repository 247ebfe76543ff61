#pragma once
/// \file
/// How far a planner's belief may be from the world, in four words.

#include <string_view>

#include "idl/types/result.hpp"

namespace jostle::physics_pool {

/// How far the planner's belief is from the world (Sec. 3.3).
enum class Uncertainty { kNone, kLow, kMedium, kHigh };

Result<Uncertainty> parse_uncertainty(std::string_view word);
const char* to_string(Uncertainty level);

/// Returns the standard deviation of the velocity noise of Eq. 3.3, per engine step and
/// degree of freedom, m/s and rad/s: 0, 0.003, 0.006, 0.009.
double velocity_noise(Uncertainty level);

}  // namespace jostle::physics_pool
