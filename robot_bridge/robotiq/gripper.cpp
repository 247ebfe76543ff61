#include "robot_bridge/robotiq/gripper.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "idl/types/number.hpp"

namespace jostle::robot_bridge::robotiq {
namespace {

// Of the linkage, m and rad.
constexpr double kX = 0.03716, kY = 0.04342, kOffset = 0.0306 - 0.0253, kClosedAngle = 0.8;

}  // namespace

std::string_view fault_text(int fault) {
  switch (fault) {
    case 0:
      return "none";
    case 5:
      return "it must be activated first";
    case 7:
      return "the activation bit is missing";
    case 8:
      return "too hot";
    case 9:
      return "no communication for a second";
    case 10:
      return "too low a voltage";
    case 11:
      return "an automatic release is under way";
    case 12:
      return "an internal fault";
    case 13:
      return "the activation failed";
    case 14:
      return "too much current";
    case 15:
      return "an automatic release is finished";
    default:
      return "unknown";
  }
}

// The linkage: half the opening is kX·cos(angle) - kY·sin(angle) + kOffset.
double opening_of(int position) {
  const double share = static_cast<double>(position - kOpenCount) / (kClosedCount - kOpenCount);
  const double angle = kClosedAngle * std::clamp(share, 0.0, 1.0);
  return std::max(0.0, 2.0 * (kX * std::cos(angle) - kY * std::sin(angle) + kOffset));
}

int position_of(double opening) {
  const double cosine = (0.5 * std::clamp(opening, 0.0, kStroke) - kOffset) / std::hypot(kX, kY);
  const double angle = std::acos(std::clamp(cosine, -1.0, 1.0)) - std::atan2(kY, kX);
  return kOpenCount +
         static_cast<int>(std::lround(std::clamp(angle / kClosedAngle, 0.0, 1.0) * (kClosedCount - kOpenCount)));
}

int speed_count(double speed) {
  const double share = (std::abs(speed) - kSlowest) / (kFastest - kSlowest);
  return static_cast<int>(std::ceil(255.0 * std::clamp(share, 0.0, 1.0)));
}

double speed_of(int count) { return kSlowest + (kFastest - kSlowest) * std::clamp(count, 0, 255) / 255.0; }

std::string set_request(std::string_view variable, int value) { return fmt::format("SET {} {}\n", variable, value); }

std::string move_request(int position, int speed, int force) {
  return fmt::format("SET POS {} SPE {} FOR {} GTO 1\n", position, speed, force);
}

std::string get_request(std::string_view variable) { return fmt::format("GET {}\n", variable); }

std::optional<int> read_answer(std::string_view variable, std::string_view line) {
  if (!line.starts_with(variable) || line.size() <= variable.size() || line[variable.size()] != ' ') return {};
  return parse_whole<int>(line.substr(variable.size() + 1), 0, 255);
}

}  // namespace jostle::robot_bridge::robotiq
