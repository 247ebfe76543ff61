#pragma once
/// \file
/// Random worlds of Sec. 3.3.1.

#include <cstdint>

#include "idl/types/result.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

struct GenerateOptions {
  int objects = 15;  ///< movable objects beside the target, 0 to 40
  std::uint64_t seed = 1;
  /// m; side of the square table. 0 means the thesis's 0.6 m or, for more than 15
  /// objects, as much more as keeps the clutter as dense.
  double table = 0.0;
  /// m; least distance of an object's centre from the surface's edge. The
  /// thesis says only "on the table"; here everything starts in the safe zone.
  double edge_distance = 0.08;
  double gap = 0.003;  ///< m; least distance between two objects
};

/// Makes a table, of 0.6 m x 0.6 m unless told, with random boxes and cylinders. Ranges are those
/// of the thesis's footnote 1 of Ch. 3, read as full extents; the target is a
/// box of the same range, because a cylinder of 70 to 80 mm leaves an 85 mm
/// gripper no room. Its position is normal about the centre, sigma 1 cm.
/// Errors   kInvalidArgument  objects out of range, or no place found for them.
Result<Scene> generate_chapter3(const GenerateOptions& options);

}  // namespace jostle::physics_pool
