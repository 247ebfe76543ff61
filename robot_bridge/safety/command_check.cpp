#include "robot_bridge/safety/command_check.hpp"

#include <fmt/format.h>

#include <cmath>

namespace jostle::robot_bridge {

Result<void> check_command(std::span<const double> u, std::span<const double> limits, double duration) {
  if (u.size() != limits.size()) {
    return Error{Code::kInvalidArgument, fmt::format("velocities: got {} values, wanted {}", u.size(), limits.size())};
  }
  for (std::size_t i = 0; i < u.size(); ++i) {
    if (std::abs(u[i]) <= limits[i]) continue;  // false for NaN
    return Error{Code::kInvalidArgument,
                 fmt::format("velocities[{}]: got {}, wanted -{} to {} m/s or rad/s", i, u[i], limits[i], limits[i])};
  }
  if (!(duration > 0 && duration <= kLongestAction)) {
    return Error{Code::kInvalidArgument,
                 fmt::format("duration: got {} s, wanted more than 0, at most {} s", duration, kLongestAction)};
  }
  return {};
}

}  // namespace jostle::robot_bridge
