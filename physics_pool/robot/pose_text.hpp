#pragma once
/// \file
/// Poses as robots and scenes write them down.

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <string>

#include "idl/types/pose.hpp"

namespace jostle::physics_pool {

/// Returns "{position: [x, y, z], orientation: [w, x, y, z]}"; fmt's {} is the shortest text that reads back to the
/// same double.
inline std::string pose_text(const Pose& pose) {
  return fmt::format("{{position: [{}], orientation: [{}]}}", fmt::join(pose.position, ", "),
                     fmt::join(pose.orientation, ", "));
}

}  // namespace jostle::physics_pool
