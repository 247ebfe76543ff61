#pragma once
/// \file
/// Random worlds after Sec. 4.5.3: a shelf, and a target behind other objects.

#include <cstdint>

#include "idl/types/result.hpp"
#include "physics_pool/scene/scene.hpp"

namespace jostle::physics_pool {

struct GenerateShelfOptions {
  int objects = 9;  ///< movable objects beside the target, 2 to 15; the thesis's D is 10 with it
  std::uint64_t seed = 1;
};

/// Makes a shelf of 0.6 m x 0.5 m, open towards the planar gripper, with random boxes and cylinders. The target, a box,
/// is at the back; two others are within 2 cm of the straight line from the hand to it, in front of it, so that this
/// line pushes them along. Masses and frictions are those of Table 4.1, sizes those of Sec. 3.3.1, since the thesis
/// gives none; its own objects are from the YCB set, and its robot an arm. Errors   kInvalidArgument  objects out of
/// range, or no place found for them.
Result<Scene> generate_chapter4(const GenerateShelfOptions& options);

}  // namespace jostle::physics_pool
